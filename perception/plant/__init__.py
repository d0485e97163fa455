"""Plant model: spurs, canes, their numbers, and the map over all frames."""
