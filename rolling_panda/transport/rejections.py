"""Rejected messages, counted by topic and reason."""

import threading
from collections import Counter

from rolling_panda import messages as m


class Rejections:
    """Counts rejected messages by topic and reason."""

    def __init__(self) -> None:
        """Start at zero."""
        self._counts: Counter[tuple[str, m.Reason]] = Counter()
        self._lock = threading.Lock()

    def add(self, topic: str, reason: m.Reason) -> None:
        """Count one rejection."""
        with self._lock:
            self._counts[topic, reason] += 1

    def counts(self) -> tuple[m.RejectionCount, ...]:
        """All counts, most frequent first."""
        with self._lock:
            rows = self._counts.most_common(50)
        return tuple(m.RejectionCount(topic, reason, count) for (topic, reason), count in rows)
