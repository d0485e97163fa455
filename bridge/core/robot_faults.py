"""Faults that the robot reports: logged once, and latched if a person has to inspect them first."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass

from rolling_panda import reasons
from rolling_panda.messages.robot import StopRequest
from rolling_panda.messages.types import Reason

# Time for the robot to recover after a person's release, before it is stopped again (s).
_RECOVERY_S = 3.0


@dataclass(frozen=True)
class FaultChange:
    """Begin or end of a fault: what is logged, and the stop to latch if the fault is severe."""

    told: Reason
    stop: StopRequest | None


def draw_id() -> str:
    """The random part of a stop's id, 64 bits."""
    return secrets.token_hex(8)


class RobotFaults:
    """Tracks the robot's faults from measurement to measurement. Times are the robot's (s)."""

    def __init__(self, draw: Callable[[], str] = draw_id) -> None:
        """Start without a fault; `draw` draws the random part of a stop's id."""
        self._draw = draw
        self.current: Reason | None = None
        self.releases = 0
        self._recovering_until = float("-inf")

    def follow(self, fault: Reason | None, severe: bool, stopped: bool, now: float) -> FaultChange | None:
        """Change of the fault by the newest measurement; None without one.

        Args:
            fault: Why the robot does not move; None when it does.
            severe: Whether a person has to release it.
            stopped: Whether a stop is latched already.
            now: Present time.
        """
        new = fault != self.current
        # A fault that persists after its release latches a new stop.
        again = fault is not None and severe and not stopped and now >= self._recovering_until
        if not new and not again:
            return None
        self.current = fault
        if fault is None:
            return FaultChange(reasons.robot_ready_again(), None)
        stop = None
        if severe and not stopped and now >= self._recovering_until:
            stop = StopRequest(stop_id=f"robot-{self._draw()}", source="robot", user="", reason=fault)
        return FaultChange(reasons.robot_faulty(fault), stop)

    def released(self, now: float) -> None:
        """A person has released the stop: the robot may recover."""
        self.releases += 1
        self._recovering_until = now + _RECOVERY_S
