"""Tasks of the null space, one a file. To add one, write its file and put it into `hierarchy.secondary_tasks`."""
