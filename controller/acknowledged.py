"""Nothing is told to anybody before the ledger holds it: answers and states wait for what they tell to be durable."""

from collections import deque
from collections.abc import Callable

from controller.journal import LedgerState

#: What cannot be made durable within this time is told as not recorded (s).
_PATIENCE_S = 0.6


class Acknowledged:
    """Things to say, in the order of the records that they rest on. No clock: `now` is given."""

    def __init__(self) -> None:
        """Start with nothing to say."""
        self._waiting: deque[tuple[int, float, Callable[[str], None]]] = deque()

    def hold(self, number: int, now: float, say: Callable[[str], None]) -> None:
        """Call `say` once all records up to `number` are durable.

        It is given an empty text then, or why they are not.
        """
        self._waiting.append((number, now, say))

    def settle(self, ledger: LedgerState, now: float) -> None:
        """Say what may be said now."""
        while self._waiting:
            number, since, say = self._waiting[0]
            why = ""
            if number > ledger.durable:
                why = ledger.failure
                if not why and now - since > _PATIENCE_S:
                    why = f"the ledger has not taken it within {_PATIENCE_S} s"
                if not why:
                    return
            self._waiting.popleft()
            say(why)
