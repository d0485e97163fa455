"""The real processes on loopback, by the name that tests know them by."""

from benchmarks.faults.live_robot import LiveRobot, free_port

__all__ = ["LiveRobot", "free_port"]
