"""Faults in simulated worlds and between real processes, and the judge of what the actuators did."""
