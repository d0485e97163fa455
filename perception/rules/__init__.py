"""Pruning rules, keep-out zones of the blades, and points by hand."""
