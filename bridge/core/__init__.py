"""Core of the bridge: validation, limits, latches, watchdog and cut memory. No wire."""
