"""How often one session may ask for motion: what comes faster is refused, and moves nothing."""

from rolling_panda.errors import InputError
from server.connections.token_bucket import TokenBucket

MOST_HZ = 60.0
#: What a busy browser had to keep back may come at once, up to so many requests.
_AT_ONCE = 20.0


class MotionRate:
    """A bucket of tokens a session. No clock here: `now` is given (s)."""

    def __init__(self) -> None:
        """Nobody has asked yet."""
        self._buckets: dict[str, TokenBucket] = {}

    def count(self, session_id: str, now: float) -> None:
        """A session asks for motion.

        Raises:
            InputError: It does so too often.
        """
        if not self._buckets.setdefault(session_id, TokenBucket(MOST_HZ, _AT_ONCE)).take(now):
            raise InputError(f"at most {MOST_HZ:.0f} requests for motion a second; ask less often")

    def forget(self, session_id: str) -> None:
        """That session has ended."""
        self._buckets.pop(session_id, None)
