"""Control: step time, reach, rows worked off, and what recording costs."""
