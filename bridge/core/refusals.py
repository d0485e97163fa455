"""Refused messages: every one is counted, the first of a kind is logged at once, the others are summarized."""

import threading
from dataclasses import dataclass

from rolling_panda import reasons
from rolling_panda.messages.robot import RejectionCount
from rolling_panda.messages.types import Reason
from rolling_panda.transport.rejections import Rejections

_KINDS = 50
_OTHER = reasons.other_refusals()


@dataclass
class _Kind:
    unsaid: int
    next_line: float


class Refusals:
    """Counts refusals by topic and reason. Logs each kind once in `quiet_s` at most. Thread-safe."""

    def __init__(self, rejections: Rejections | None = None, quiet_s: float = 5.0) -> None:
        """Share `rejections` with the transport, so that undecodable messages appear in the same table."""
        self._rejections = rejections if rejections is not None else Rejections()
        self._quiet = quiet_s
        self._kinds: dict[tuple[str, Reason], _Kind] = {}
        self._lock = threading.Lock()

    def add(self, topic: str, reason: Reason) -> None:
        """Count one refusal of the bridge's own and log it."""
        self._rejections.add(topic, reason)
        self.log(topic, reason)

    def log(self, topic: str, reason: Reason) -> None:
        """Log one refusal that has been counted elsewhere."""
        with self._lock:
            known = (topic, reason) in self._kinds or len(self._kinds) < _KINDS
            key = (topic, reason if known else _OTHER)
            self._kinds.setdefault(key, _Kind(0, float("-inf"))).unsaid += 1

    def counts(self) -> tuple[RejectionCount, ...]:
        """All refusals since the start."""
        return tuple(row for row in self._rejections.counts())

    def lines(self, now: float) -> list[Reason]:
        """What is due for the log (s, the bridge's clock)."""
        out = []
        with self._lock:
            for (topic, reason), kind in self._kinds.items():
                if kind.unsaid and now >= kind.next_line:
                    once = kind.unsaid == 1
                    out.append(
                        reasons.refused_once_on(topic, reason)
                        if once
                        else reasons.refused_on(topic, reason, kind.unsaid)
                    )
                    kind.unsaid, kind.next_line = 0, now + self._quiet
        return out
