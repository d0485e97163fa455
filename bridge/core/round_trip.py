"""Round-trip time from a joint state to the command that answers it."""

from collections import OrderedDict, deque

_WINDOW_S = 1.0
# Joint states in a second at the highest rate. Older ones are not expected to be answered.
_REMEMBERED = 1000


class RoundTrip:
    """Round-trip times of the last second, on the machine's clock (s)."""

    def __init__(self) -> None:
        """Start without samples."""
        self._sent: OrderedDict[int, float] = OrderedDict()
        self._samples: deque[tuple[float, float]] = deque()

    def out(self, sequence: int, clock: float) -> None:
        """Joint state `sequence` goes out."""
        self._sent[sequence] = clock
        if len(self._sent) > _REMEMBERED:
            self._sent.popitem(last=False)

    def back(self, sequence: int, clock: float) -> None:
        """A command came that answers joint state `sequence`."""
        sent = self._sent.get(sequence)
        if sent is not None:
            self._samples.append((clock, max(0.0, clock - sent)))

    def forget(self, clock: float) -> None:
        """Remove times older than a second."""
        while self._samples and clock - self._samples[0][0] > _WINDOW_S:
            self._samples.popleft()

    @property
    def median(self) -> float:
        """Median; 0 without samples."""
        times = sorted(taken for _, taken in self._samples)
        return times[len(times) // 2] if times else 0.0

    @property
    def worst(self) -> float:
        """The longest; 0 without samples."""
        return max((taken for _, taken in self._samples), default=0.0)
