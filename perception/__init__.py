"""From camera frames to pruning points with reasons."""
