"""The 3-D view; all of viser is in here."""
