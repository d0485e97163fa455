"""Tasks of the null space, one in each file. To add one, write its file and add it to `hierarchy.secondary_tasks`."""
