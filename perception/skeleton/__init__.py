"""Cane pixels to canes: fragments, links, centre lines and topology."""
