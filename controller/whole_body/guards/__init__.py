"""Inequality constraints with priority over the tool task, one source in each file."""
