"""Fake devices of the robot, for the makers' own client libraries."""
