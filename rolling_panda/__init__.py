"""What the five processes of Rolling Panda share: messages, topics, transport, configuration and the robot model."""

__version__ = "0.1.0"
