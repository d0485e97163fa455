"""How often a page may say something: far more than any page does, far less than would keep the server busy."""

FRAMES_HZ = 200.0
#: What a browser that hung for a moment had to keep back may come at once.
_AT_ONCE = 400.0


class Frames:
    """A bucket of frames. No clock here: `now` is given (s)."""

    def __init__(self) -> None:
        """Nothing has been said."""
        self._tokens, self._at = _AT_ONCE, float("-inf")

    def admits(self, now: float) -> bool:
        """Whether one more frame may come now."""
        self._tokens = min(_AT_ONCE, self._tokens + (now - self._at) * FRAMES_HZ)
        self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
