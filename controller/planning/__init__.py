"""Planning: where to stand, how to hold the arm, and how to get there within the limits. Pure: no clock, no wire."""
