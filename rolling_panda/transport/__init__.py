"""Zenoh: publishers, newest-wins slots, feeds, services, and access control."""
