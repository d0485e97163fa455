"""How much of the log one person or visitor can fill: what comes faster is counted and told with the next line.

The log goes into the robot's ledger, and nobody with a script may fill its disk. No clock here: `now` is given (s).
"""

from collections import OrderedDict
from dataclasses import dataclass, field

from server.connections.token_bucket import TokenBucket

#: So many lines at once, and so many a second after that.
AT_ONCE, LINES_HZ = 20.0, 1.0
#: Of more sources than these the oldest are forgotten.
_SOURCES = 1000


@dataclass
class _Source:
    lines: TokenBucket = field(default_factory=lambda: TokenBucket(LINES_HZ, AT_ONCE))
    left_out: int = 0


class LogRateLimiter:
    """A bucket of lines for each source."""

    def __init__(self) -> None:
        """Nobody has said anything."""
        self._sources: OrderedDict[str, _Source] = OrderedDict()

    def line(self, source: str, text: str, now: float) -> str:
        """The line to write for what `source` did; empty where it has written enough for now."""
        known = self._sources.setdefault(source, _Source())
        self._sources.move_to_end(source)
        if len(self._sources) > _SOURCES:
            self._sources.popitem(last=False)
        if not known.lines.take(now):
            known.left_out += 1
            return ""
        more, known.left_out = known.left_out, 0
        return f"{text} (and {more} lines like it before)" if more else text
