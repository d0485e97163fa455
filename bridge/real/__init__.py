"""The real robot: base, arm, cutter and camera, each behind its maker's own interface."""
