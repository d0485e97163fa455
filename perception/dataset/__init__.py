"""Labelled pictures of vines: one format on disk, and what other programs write."""
