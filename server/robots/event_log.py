"""The log that the page shows: the last lines of every process, numbered."""

from collections import deque

from rolling_panda import messages as m
from rolling_panda.messages.page import PageEvent


class EventLog:
    """Keeps the last lines. Not thread-safe: the server's event loop alone touches it."""

    def __init__(self, lines: int) -> None:
        """Keep up to `lines` lines."""
        self._events: deque[PageEvent] = deque(maxlen=lines)
        self.number = 0

    def add(self, process: str, severity: m.Severity, text: str, wall_time: float) -> None:
        """Append a line; `wall_time` is s since 1970, for people."""
        self.number += 1
        self._events.append(PageEvent(self.number, wall_time, process, severity, text))

    def after(self, number: int, at_most: int) -> tuple[PageEvent, ...]:
        """The newest `at_most` lines that came after line `number`, oldest first."""
        waiting = min(self.number - number, len(self._events), at_most)
        if waiting <= 0:
            return ()
        return tuple(self._events[index] for index in range(len(self._events) - waiting, len(self._events)))
