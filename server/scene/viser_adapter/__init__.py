"""Everything that relies on more of viser than its public interface; `contract.py` lists it."""
