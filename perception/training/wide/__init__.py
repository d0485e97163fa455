"""Training of a network with a pretrained encoder on drawn pictures, for photographs of real vines."""
