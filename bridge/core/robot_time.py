"""The time that a robot's watchdog and all ages run on: how many steps of 1 ms are due, and what time each one has."""

from typing import Protocol

# A bridge that has fallen behind takes no more than this many steps at once.
_BURST = 20


class RobotTime(Protocol):
    """Counts steps against the machine's clock (s)."""

    @property
    def now(self) -> float:
        """The robot's time of the last step (s)."""

    def due(self, clock: float) -> int:
        """How many steps to take at this moment."""

    def tick(self) -> float:
        """Take one step; returns its time."""


class SteppedTime:
    """A simulated robot stands still while nobody steps it: its time is the number of steps done.

    So a machine that is suspended for a moment, or too slow, loses time and no more.
    """

    # Behind by more than this (s), time runs slower instead of hurrying.
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
    """A real robot goes on while nobody steps it: its time is the clock's, and steps that were missed are left out.

    After a standstill the first step has the present time, so that the watchdog finds the silence as long as it was.
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
