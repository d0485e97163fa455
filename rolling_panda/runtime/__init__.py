"""How a process starts, keeps time, keeps state and ends."""
