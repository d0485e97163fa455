"""The log that the page shows: the last lines of every process, numbered, and a rate limit for each source of lines."""

import time
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.page import PageEvent
from rolling_panda.reasons import severity_of, text_of
from rolling_panda.runtime.token_bucket import TokenBucket

#: Lines of one source: at once, and per second after that.
BURST, RATE_HZ = 20.0, 1.0
#: With more sources than these the oldest are forgotten.
_MAX_SOURCES = 1000


class EventLog:
    """Keeps the last lines. Not thread-safe: it belongs to the server's event loop."""

    def __init__(self, lines: int) -> None:
        """Keep up to `lines` lines."""
        self._events: deque[PageEvent] = deque(maxlen=lines)
        self.number = 0

    def add(self, process: str, reason: m.Reason, wall_time: float) -> None:
        """Append a line; `wall_time` is Unix time (s)."""
        self.number += 1
        self._events.append(PageEvent(self.number, wall_time, process, severity_of(reason), text_of(reason), reason))

    def after(self, number: int, at_most: int) -> tuple[PageEvent, ...]:
        """The newest `at_most` lines after line `number`, oldest first."""
        count = min(self.number - number, len(self._events), at_most)
        return tuple(self._events)[len(self._events) - count :] if count > 0 else ()


@dataclass
class _Source:
    lines: TokenBucket = field(default_factory=lambda: TokenBucket(RATE_HZ, BURST))
    left_out: int = 0


class LogRateLimiter:
    """Limits the lines of each source, since the robot's ledger stores them; left-out lines are counted.

    No clock here: `now` is given (s).
    """

    def __init__(self) -> None:
        """No source is known."""
        self._sources: OrderedDict[str, _Source] = OrderedDict()

    def line(self, source: str, reason: m.Reason, now: float) -> m.Reason | None:
        """The line to write; None while the source is over its limit."""
        known = self._sources.setdefault(source, _Source())
        self._sources.move_to_end(source)
        if len(self._sources) > _MAX_SOURCES:
            self._sources.popitem(last=False)
        if not known.lines.take(now):
            known.left_out += 1
            return None
        left_out, known.left_out = known.left_out, 0
        return reasons.lines_left_out(reason, left_out) if left_out else reason


class RobotLog:
    """The log of one robot: lines of every process for its pages, and the server's own lines for its ledger too.

    Attributes:
        lines: The last lines.
    """

    def __init__(self, lines: int, send: Callable[[m.Reason, float], object]) -> None:
        """Keep up to `lines` lines; `send(reason, now)` publishes a line of the server."""
        self.lines = EventLog(lines)
        self._send = send
        self._limiter = LogRateLimiter()

    def note(self, reason: m.Reason, by: str = "") -> None:
        """Write a line of the server; `by` is the source whose rate is limited, empty for none."""
        now = time.monotonic()
        line = self._limiter.line(by, reason, now) if by else reason
        if line is not None:
            self.lines.add("server", line, time.time())
            self._send(line, now)
