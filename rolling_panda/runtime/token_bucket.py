"""A rate limit that allows a burst. No clock here: `now` is given (s)."""

from collections import OrderedDict


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


class TokenBuckets:
    """A bucket for each key; of more than `most` keys the ones that came first are forgotten."""

    def __init__(self, rate_hz: float, at_once: float, most: int = 1000) -> None:
        """All full."""
        self._rate_hz, self._at_once, self._most = rate_hz, at_once, most
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()

    def take(self, key: str, now: float) -> bool:
        """Take a token of the key's bucket; False where there is none."""
        bucket = self._buckets.setdefault(key, TokenBucket(self._rate_hz, self._at_once))
        if len(self._buckets) > self._most:
            self._buckets.popitem(last=False)
        return bucket.take(now)
