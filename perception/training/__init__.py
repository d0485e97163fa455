"""Trains the segmentation network on rendered rows; nothing that runs imports it. Needs the extra `training`."""
