"""Pictures of the calibration's board at rest, and what a first one without the board comes to."""

import numpy as np

from controller.motion.follower import Measured
from controller.work.close_up import CloseUpClient, no_picture
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.messages.types import Reason

#: The robot rests for this time before a picture (s), its wheels and joints commanded slower than this (rad/s).
_REST_S, _STILL = 0.5, 1e-3


class PictureAtRest:
    """One picture once the robot has come to rest. Call `step` in each period, and command rest, until it answers."""

    def __init__(self, close_ups: CloseUpClient, name: str) -> None:
        """Ask `close_ups` for the picture of this name."""
        self._close_ups, self._name = close_ups, name
        self._rested_at: float | None = None
        self._asked = False

    def step(self, robot: Measured, now: float) -> CloseUpResult | None:
        """What the picture shows; None until it has come.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        if self._rested_at is None or float(np.abs(robot.sent).max()) > _STILL:
            self._rested_at = now
        if now - self._rested_at < _REST_S:
            return None
        if not self._asked:
            self._asked = True
            self._close_ups.ask(self._name, "seen", now)
        answer = self._close_ups.answer(self._name, now)
        if answer is not None:
            self._close_ups.forget(self._name)
        return answer


def not_begun(first: CloseUpResult) -> Reason:
    """Why a calibration ends before it has begun: its first picture does not show the board, or has not come."""
    cause = first.reason or reasons.board_not_in_picture()
    return reasons.board_without_picture(cause) if no_picture(first) else reasons.board_not_ahead(cause)
