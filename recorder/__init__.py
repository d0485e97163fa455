"""Recording and replay: what was on the robot's wire, as MCAP files."""
