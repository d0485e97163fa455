"""How fast the robot's time runs against the bridge's clock."""

from collections import deque

_WINDOW_S = 1.0


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
