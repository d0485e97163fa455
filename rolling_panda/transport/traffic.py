"""How often messages of each topic come in."""

from collections import deque

#: The rate is the mean over this many messages, at most.
_MOST = 100


class Traffic:
    """Counts the messages of each topic. Threads of the wire add; any thread reads."""

    def __init__(self) -> None:
        """No topic is subscribed to."""
        self._times: dict[str, deque[float]] = {}
        self._counts: dict[str, int] = {}

    def knows(self, topic: str) -> bool:
        """Whether messages of this topic are counted."""
        return topic in self._times

    def begin(self, topic: str) -> None:
        """Count the messages of this topic from now on."""
        self._times[topic], self._counts[topic] = deque(maxlen=_MOST), 0

    def add(self, topic: str, at: float) -> None:
        """Count a message that arrived at `at` (s)."""
        self._times[topic].append(at)
        self._counts[topic] += 1

    def count(self, topic: str) -> int:
        """Number of messages so far."""
        return self._counts.get(topic, 0)

    def rate_hz(self, topic: str) -> float | None:
        """Mean rate of the newest messages; None before the second."""
        times = tuple(self._times.get(topic, ()))
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 and times[-1] > times[0] else None

    def age_s(self, topic: str, now: float) -> float | None:
        """Time since the newest message (s); None before the first."""
        times = self._times.get(topic)
        return now - times[-1] if times else None
