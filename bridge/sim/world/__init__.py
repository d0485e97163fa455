"""Disturbances of the simulated world, drawn from the seed: what a vineyard and a worn robot do to the program."""
