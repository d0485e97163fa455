"""The bridge without wires: validation, limits, latches, watchdog and cut memory."""
