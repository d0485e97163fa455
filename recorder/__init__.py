"""Recording and replay of all messages of a robot, as MCAP files."""
