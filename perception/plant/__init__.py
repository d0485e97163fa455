"""The vine as a model: spurs, canes, numbers, and the map over all frames."""
