"""Inequality constraints above the tool task, one source a file."""
