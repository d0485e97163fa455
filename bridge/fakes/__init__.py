"""Fakes of the robot's devices that the makers' own client libraries talk to; for a machine without the robot."""
