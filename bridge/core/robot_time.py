"""The robot's time, and the round trip from a joint state to the command that answers it.

Watchdog and all ages use the robot's time: the number of due steps of 1 ms, and the time of each step.
"""

from collections import OrderedDict, deque
from typing import Protocol

# Largest number of steps at once for a bridge that is late.
_BURST = 20
#: Window of the real-time factor and of the round trips (s).
_WINDOW_S = 1.0


class RobotTime(Protocol):
    """Counts the due steps by the machine's clock (s)."""

    @property
    def now(self) -> float:
        """The robot's time of the last step (s)."""

    def due(self, clock: float) -> int:
        """How many steps to take at this moment."""

    def tick(self) -> float:
        """Take one step; returns its time."""


class SteppedTime:
    """Time of a simulated robot: the number of executed steps. It stops while nobody steps the robot.

    A machine that was suspended or is too slow only loses simulated time.
    """

    # Delay beyond which time is lost instead of made up (s).
    _CATCH_UP_S = 0.1

    def __init__(self, clock: float, tick_s: float) -> None:
        """Start at `clock` (s)."""
        self._start = self._begin = clock
        self._tick_s, self._ticks = tick_s, 0

    @property
    def now(self) -> float:
        """The robot's time of the last step (s)."""
        return self._start + self._ticks * self._tick_s

    def due(self, clock: float) -> int:
        """How many steps to take at this moment."""
        due = int((clock - self._begin) / self._tick_s) - self._ticks
        if due * self._tick_s > self._CATCH_UP_S:
            self._begin += (due - _BURST) * self._tick_s
        return max(0, min(due, _BURST))

    def tick(self) -> float:
        """Take one step; returns its time."""
        self._ticks += 1
        return self.now


class RealTime:
    """Time of a real robot: the clock's. Missed steps are skipped.

    The first step after a standstill has the current time, so that the watchdog sees the full silence.
    """

    def __init__(self, clock: float, tick_s: float) -> None:
        """Start at `clock` (s)."""
        self._tick_s = tick_s
        self._due = self.now = clock

    def due(self, clock: float) -> int:
        """How many steps to take at this moment."""
        due = int((clock - self._due) / self._tick_s + 1e-6)
        if due > _BURST:
            self._due = clock - _BURST * self._tick_s
            due = _BURST
        self.now = max(self.now, clock - due * self._tick_s)
        return max(0, due)

    def tick(self) -> float:
        """Take one step; returns its time."""
        self._due += self._tick_s
        self.now = max(self.now, self._due)
        return self.now


class TimeRatio:
    """The real-time factor over the last second."""

    def __init__(self) -> None:
        """Start without samples."""
        self._samples: deque[tuple[float, float]] = deque()

    def factor(self, robot_time: float, now: float) -> float:
        """Robot seconds a second of the clock, after noting this moment; 1 until there is something to compare."""
        self._samples.append((robot_time, now))
        while len(self._samples) > 2 and now - self._samples[1][1] >= _WINDOW_S:
            self._samples.popleft()
        robot_then, then = self._samples[0]
        return (robot_time - robot_then) / (now - then) if now > then else 1.0


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
