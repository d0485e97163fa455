"""Inequalities that come before the tool's task, one source a file."""
