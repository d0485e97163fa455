"""Exponential backoff of failed sign-ins, by user name and by address, after five failures.

No clock here: `now` is given (s, monotonic). Only sign-in is delayed; signed-in sessions can always stop the robot.
"""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

FREE = 5
MAX_DELAY_S = 60.0
#: With more keys the oldest are forgotten, which bounds the memory.
_MAX_KEYS = 10_000


@dataclass
class _Failures:
    count: int = 0
    refuse_until: float = float("-inf")


class LoginThrottle:
    """Counts failed sign-ins by key, which is a user name or an address."""

    def __init__(self) -> None:
        """No attempt has failed."""
        self._failures: OrderedDict[str, _Failures] = OrderedDict()

    def wait(self, keys: Iterable[str], now: float) -> float:
        """Remaining delay (s) of an attempt with these keys; 0 when it is permitted."""
        known = (self._failures[key] for key in keys if key in self._failures)
        return max([0.0, *(failures.refuse_until - now for failures in known)])

    def failed(self, keys: Iterable[str], now: float) -> None:
        """An attempt with these keys has failed."""
        for key in keys:
            failures = self._failures.setdefault(key, _Failures())
            self._failures.move_to_end(key)
            failures.count += 1
            if failures.count >= FREE:
                failures.refuse_until = now + min(2.0 ** min(failures.count - FREE, 30), MAX_DELAY_S)
        while len(self._failures) > _MAX_KEYS:
            self._failures.popitem(last=False)

    def succeeded(self, keys: Iterable[str]) -> None:
        """An attempt with these keys has succeeded: reset their counts."""
        for key in keys:
            self._failures.pop(key, None)
