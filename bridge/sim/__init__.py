"""The simulated robot in a simulated row."""
