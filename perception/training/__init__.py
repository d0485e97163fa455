"""Training of the segmentation network on rendered rows. No process imports it. It needs the extra `training`."""
