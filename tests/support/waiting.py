"""Waiting for what other threads and processes do."""

import time
from collections.abc import Callable


def until(condition: Callable[[], object], limit_s: float = 60.0) -> float:
    """Wait until the condition holds; returns how long that took (s). It fails where the condition does not hold."""
    began = time.monotonic()
    while not condition():
        assert time.monotonic() - began < limit_s, "waited in vain"
        time.sleep(0.002)
    return time.monotonic() - began
