"""The work on accepted points: queue, order, postures, cut sequence, survey and homing."""
