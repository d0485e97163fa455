"""Whole-body control, trajectories, the supervision state machine and the queue of cuts."""
