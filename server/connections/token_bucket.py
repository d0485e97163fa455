"""A rate limit that allows a burst. No clock here: `now` is given (s)."""


class TokenBucket:
    """Holds up to `at_once` tokens and gains `rate_hz` a second."""

    def __init__(self, rate_hz: float, at_once: float) -> None:
        """Full."""
        self._rate_hz, self._at_once = rate_hz, at_once
        self._tokens, self._at = at_once, float("-inf")

    def take(self, now: float, tokens: float = 1.0) -> bool:
        """Take so many tokens; False, and none is taken, where there are fewer."""
        self._tokens = min(self._at_once, self._tokens + (now - self._at) * self._rate_hz)
        self._at = now
        if self._tokens < tokens:
            return False
        self._tokens -= tokens
        return True
