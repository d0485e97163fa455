"""Shared code of the five processes: messages, topics, transport, configuration and the robot model."""

__version__ = "0.1.0"
