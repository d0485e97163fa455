"""Where the robot is in the row: the transform from odom to map, from wood that was seen before."""
