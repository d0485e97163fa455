"""Modes, health of the inputs, lease, permission and stops: whether the robot may move."""
