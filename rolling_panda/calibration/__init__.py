"""Calibration of the camera on the hand: its target, and the file that keeps the result."""
