"""Timeout of a motion and the text for a motion that misses its goal."""

import numpy as np

from controller.motion.follower import Tracking
from rolling_panda import reasons
from rolling_panda.messages.types import Reason

#: A motion that is blocked without a break for this time (s) has timed out.
_HELD_S = 3.0
#: Below this rate the clock of a motion counts as stopped.
_STANDS = 0.02


class MotionTimeout:
    """Timeout of one motion at a time. Call `begin` at its start and `note` with the tracking of each period."""

    def __init__(self, timeout_s: float, dt: float) -> None:
        """Wait so long past a motion's planned end.

        Args:
            timeout_s: Beyond two and a half times the planned duration (s).
            dt: Control period (s).
        """
        self._timeout_s, self._dt = timeout_s, dt
        self.start(0.0)

    def start(self, duration: float) -> None:
        """A new motion of this planned duration (s)."""
        self._duration = duration
        self.again()

    def again(self) -> None:
        """Restart the timeout of the same motion."""
        self._started: float | None = None
        self._held_s = 0.0

    def note(self, tracking: Tracking) -> None:
        """How the motion was followed in this period."""
        held = bool(tracking.reason) and tracking.scale < _STANDS and not tracking.done
        self._held_s = self._held_s + self._dt if held else 0.0

    def over(self, tracking: Tracking, now: float, near: float, turn: float = 0.2) -> bool:
        """Whether the motion has run out and the tool is in place, to `near` (m) and `turn` (rad)."""
        if self._started is None:
            self._started = now
        return tracking.done and tracking.position_error <= near and tracking.rotation_error <= turn

    def late(self, now: float) -> bool:
        """Whether the motion has timed out: it is blocked, or far past its planned end."""
        if self._held_s > _HELD_S:
            return True
        return self._started is not None and now - self._started > 2.5 * self._duration + self._timeout_s


def missed(goal: str, tracking: Tracking) -> Reason:
    """The remaining error of a motion to `goal`, and its cause."""
    left = 1e3 * tracking.position_error, float(np.degrees(tracking.rotation_error))
    if tracking.reason:
        return reasons.not_reached_for(goal, *left, tracking.reason)
    return reasons.not_reached(goal, *left)
