"""Pruning rules: from a spur to cuts, and what the blades must keep out of."""
