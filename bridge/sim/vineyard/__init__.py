"""The simulated row, its growth, its file and its truth."""
