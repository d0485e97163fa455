"""Connections to the server: limits of their number, times and rates."""
