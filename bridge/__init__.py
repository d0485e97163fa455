"""The robot behind one interface: simulated or real, with its own watchdog and limits."""
