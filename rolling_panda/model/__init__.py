"""Kinematics of the robot and of its base."""
