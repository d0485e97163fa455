"""Obstacle map of posts, trunks, cordons and wires."""
