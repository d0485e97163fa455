"""Posts, trunks, cordons and wires that the robot keeps away from."""
