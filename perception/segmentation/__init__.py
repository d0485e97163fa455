"""Decoded frames and their semantic segmentation."""
