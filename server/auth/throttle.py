"""How long whoever guesses has to wait: after five bad sign-ins a delay that doubles, for the name and for the address.

No clock here: `now` is seconds of a monotonic clock, given by the caller. Only signing in waits; who is signed in can
always stop the robot.
"""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

FREE = 5
MAX_DELAY_S = 60.0
#: Somebody who tries a million names makes the oldest ones be forgotten, not the memory full.
_REMEMBERED = 10_000


@dataclass
class _Failures:
    count: int = 0
    refuse_until: float = float("-inf")


class LoginThrottle:
    """Counts bad sign-ins by key: whatever stands for who tries, or for whom they say they are."""

    def __init__(self) -> None:
        """Nobody has tried."""
        self._failures: OrderedDict[str, _Failures] = OrderedDict()

    def wait(self, keys: Iterable[str], now: float) -> float:
        """For how long (s) an attempt under any of these keys is refused; 0 when it may be made."""
        known = (self._failures[key] for key in keys if key in self._failures)
        return max([0.0, *(failures.refuse_until - now for failures in known)])

    def failed(self, keys: Iterable[str], now: float) -> None:
        """A bad attempt was made under all these keys."""
        for key in keys:
            failures = self._failures.setdefault(key, _Failures())
            self._failures.move_to_end(key)
            failures.count += 1
            if failures.count >= FREE:
                failures.refuse_until = now + min(2.0 ** min(failures.count - FREE, 30), MAX_DELAY_S)
        while len(self._failures) > _REMEMBERED:
            self._failures.popitem(last=False)

    def succeeded(self, keys: Iterable[str]) -> None:
        """A good attempt was made under all these keys: their count begins anew."""
        for key in keys:
            self._failures.pop(key, None)
