"""Perception: surveys of unseen rows and the judges of their points."""
