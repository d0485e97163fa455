"""Drives and turns of the base before the calibration's board, with a picture of it after each.

A first picture is taken where the robot stands; without the board in it nothing moves. The arm keeps its survey
posture, so that the camera keeps its place on the base. The base stays within 0.3 m of where it stood, and turns by at
most 30 degrees to either side.
"""

import math

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import UNNAMED, Follower, Measured, Tracking
from controller.whole_body.saturation import Saturation
from controller.work.close_up import CloseUpClient
from controller.work.homing import Homing, go_home
from controller.work.picture_at_rest import PictureAtRest, not_begun
from controller.work.step_result import StepResult
from controller.work.survey import wheels
from rolling_panda import reasons
from rolling_panda.messages.perception import BASE
from rolling_panda.model.differential_drive import NXI

#: Places along the heading at the start (m), then headings against it (degrees), round by round. The board stays in the
#: picture; the headings differ, since a picture of the same place has the same error.
ROUNDS = (
    ((0.26, -0.26, 0.0), (-22.0, 14.0, -27.0, 17.0, 0.0)),
    ((-0.22, 0.22, 0.0), (-25.0, 16.0, -20.0, 12.0, 0.0)),
    ((0.28, -0.28, 0.0), (-28.0, 18.0, -23.0, 15.0, 0.0)),
    ((-0.24, 0.24, 0.0), (-21.0, 13.0, -26.0, 18.0, 0.0)),
)
#: Speeds (m/s, rad/s) and decelerations (m/s², rad/s²).
_SPEED, _RATE, _BRAKING, _SLOWING = 0.12, 0.25, 0.15, 0.3
#: A drive or a turn has ended (m, rad); what moves by less than this in the time is held back by something (s).
_NEAR, _TURNED, _LEAST, _PATIENCE_S = 0.004, 0.005, 0.005, 3.0
#: Back to the heading and to the line of a drive: (1/s), and (1/m²) times the speed squared.
_GAIN_HEADING, _GAIN_ASIDE = 1.2, 6.0


class BaseViews:
    """One round of drives, turns and pictures. Call `step` in each period until it is finished."""

    def __init__(
        self, config: ControllerConfig, follower: Follower, saturation: Saturation, close_ups: CloseUpClient
    ) -> None:
        """Bind the parts.

        Args:
            config: Section `[controller]`.
            follower: Follower for motions of arm and base.
            saturation: Braking to rest.
            close_ups: Client for the pictures.
        """
        self._follower, self._saturation, self._close_ups = follower, saturation, close_ups
        self._legs: list[tuple[bool, float]] = []
        for places, headings in ROUNDS:
            self._legs += [(True, place) for place in places]
            self._legs += [(False, math.radians(heading)) for heading in headings]
        self._all, self._number, self._seen = len(self._legs) + 1, 1, 0
        self._picture = PictureAtRest(close_ups, f"{BASE}1")
        self._begun = False
        self._homing: Homing | None = Homing(config, follower, 1.0 / config.rate_hz)
        self._start: tuple[float, float, float] | None = None
        self._leg: tuple[bool, float] | None = None
        self._moved: tuple[float, float] = math.inf, 0.0

    def hold(self) -> None:
        """The robot stands for one period: nothing is held back."""
        self._moved = math.inf, 0.0

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        if not self._begun:
            return self._look_first(robot, now)
        if self._homing is not None:
            result = go_home(self._homing, robot, self._saturation, reasons.calibration_blocked)
            if self._homing.done:
                self._homing = None
            return result
        if self._start is None:
            x, y, heading = robot.q[:3].tolist()
            self._start = x, y, heading
        if self._leg is not None:
            return self._move(robot, self._start, self._leg, now)
        return self._look(robot, now)

    def _move(
        self, robot: Measured, start: tuple[float, float, float], leg: tuple[bool, float], now: float
    ) -> StepResult:
        straight, goal = leg
        x, y, heading = start
        c, s = math.cos(heading), math.sin(heading)
        along = c * (robot.q[0] - x) + s * (robot.q[1] - y)
        aside = c * (robot.q[1] - y) - s * (robot.q[0] - x)
        turned = math.remainder(float(robot.q[2]) - heading, math.tau)
        left = float(goal - (along if straight else turned))
        if abs(left) < (_NEAR if straight else _TURNED):
            self._leg = None
            return StepResult(self._saturation.ramp(robot.sent))
        if abs(left - self._moved[0]) > _LEAST:
            self._moved = left, now
        speed = turning = 0.0
        if straight:
            speed = math.copysign(min(_SPEED, math.sqrt(2.0 * _BRAKING * abs(left))), left)
            turning = -_GAIN_HEADING * turned - _GAIN_ASIDE * speed * float(aside)
        else:
            turning = math.copysign(min(_RATE, math.sqrt(2.0 * _SLOWING * abs(left))), left)
        xi = np.zeros(NXI)
        xi[:2] = wheels(robot, speed, turning)
        tracking: Tracking = self._follower.jog(xi, robot)
        if now - self._moved[1] > _PATIENCE_S:
            why = reasons.base_blocked(tracking.reason or UNNAMED)
            return StepResult(self._saturation.ramp(robot.sent), pause=why)
        return StepResult(tracking.xi)

    def _look_first(self, robot: Measured, now: float) -> StepResult:
        """Take a picture where the robot stands, which need not be in the survey posture."""
        xi, answer = self._saturation.ramp(robot.sent), self._picture.step(robot, now)
        if answer is None:
            return StepResult(xi)
        if answer.finding != "seen":
            return StepResult(xi, finished=True, summary=not_begun(answer))
        # The round begins anew in the survey posture, since the camera has to keep its place on the base.
        self._begun, self._picture = True, PictureAtRest(self._close_ups, f"{BASE}1")
        return StepResult(xi)

    def _look(self, robot: Measured, now: float) -> StepResult:
        """Come to rest, take a picture, and begin the next leg."""
        xi, answer = self._saturation.ramp(robot.sent), self._picture.step(robot, now)
        if answer is None:
            return StepResult(xi)
        if self._number == 1 and answer.finding != "seen":
            return StepResult(xi, finished=True, summary=not_begun(answer))
        self._seen += answer.finding == "seen"
        if not self._legs:
            return StepResult(xi, finished=True, summary=reasons.board_seen(self._seen, self._all))
        self._number += 1
        self._picture = PictureAtRest(self._close_ups, f"{BASE}{self._number}")
        self._leg, self._moved = self._legs.pop(0), (math.inf, now)
        return StepResult(xi)
