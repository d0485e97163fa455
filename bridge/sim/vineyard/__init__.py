"""The simulated row: growth, files and ground truth."""
