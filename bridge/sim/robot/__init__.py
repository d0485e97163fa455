"""The simulated base, arm and cutter."""
