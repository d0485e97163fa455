"""The simulated eye-in-hand camera."""
