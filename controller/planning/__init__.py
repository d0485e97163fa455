"""Planning of base poses, arm postures and motions within the limits. Pure: no clock, no wire."""
