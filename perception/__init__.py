"""Camera frames to pruning points that explain themselves."""
