"""Frames and photographs to a class for each pixel."""
