"""Postures from which the camera looks at the calibration's board, or at the row, and the work that takes the pictures.

The base stands still. What is looked at stands about where it should be before the camera in the survey posture. Where
exactly is not known, and need not be: each picture is used that shows it. For the board a first picture is taken where
the robot stands; without the board in it nothing moves.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import ControllerConfig
from controller.motion.follower import UNNAMED, ArmMotion, Follower, Measured, MotionTimeout
from controller.whole_body.saturation import Saturation
from controller.work.close_up import CloseUpClient
from controller.work.homing import Homing, go_home
from controller.work.picture_at_rest import PictureAtRest, not_begun
from controller.work.step_result import StepResult
from rolling_panda import reasons
from rolling_panda.messages.perception import ARM, CALIBRATION, CHECK
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import NQ, Array
from rolling_panda.model.robot import ARM_Q, RobotModel

#: Angle between one direction and the next about the board's normal (rad), which spreads any number of them evenly.
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
#: Steps of the inverse kinematics, its damping, and the error that is left (m, rad).
_STEPS, _DAMPING, _SOLVED = 40, 1e-3, 1e-3
#: Distance to a joint's limit that is kept (rad).
_MARGIN = 0.1
#: The arm rests for this time before a picture (s), and is in place within this angle (rad).
_REST_S, _NEAR = 0.4, 0.01


@dataclass(frozen=True)
class Views:
    """Views of one thing.

    Attributes:
        prefix: Of the names of the pictures.
        ahead: Its distance before the camera in the survey posture (m).
        count: Directions of view.
        tilt: How far they are from square, the least and the most (degrees).
        distances: Of the camera from it, in turn (m).
        rolls: Turns about the optical axis, in turn (degrees).
        clear: Least distance of the tool from its plane (m).
        elbows: Turns of the shoulder out of the survey posture, in turn (rad), by which the elbow swings aside.
    """

    prefix: str
    ahead: float
    count: int
    tilt: tuple[float, float]
    distances: tuple[float, ...]
    rolls: tuple[float, ...]
    clear: float
    elbows: tuple[float, ...] = (0.0,)


#: Of the board: its marks can still be read, and the views are turned enough to tell a turn about the optical axis.
BOARD = Views(CALIBRATION, 0.45, 42, (8.0, 48.0), (0.42, 0.34, 0.54), (0.0, 35.0, -35.0, 60.0, -60.0), 0.12)
#: The same for the joints of the arm. A swing of the elbow turns each of them without moving the camera: it tells their
#: offsets apart from the place of the board and the mount of the camera.
JOINTS = replace(BOARD, prefix=ARM, elbows=(0.0, 0.6, -0.6))
#: Of the row: from so far away that whole spurs are seen, with the image upright.
ROW = Views(CHECK, 0.75, 8, (8.0, 20.0), (0.85, 0.62, 0.75), (0.0, 12.0, -12.0), 0.24)

Refusal = Callable[[Array, Array], Reason | None]


def view_postures(robot: RobotModel, home: Array, views: Views = BOARD) -> tuple[Array, ...]:
    """Postures of the arm (7, rad) with the camera on a thing, in an order with short ways.

    Args:
        robot: Its `data` is overwritten.
        home: Survey posture (7, rad).
        views: What is looked at; views that the arm cannot reach are left out.
    """
    q = np.zeros(NQ)
    q[ARM_Q] = home
    ahead = robot.pose(q, robot.camera_id)
    middle = ahead.translation + views.ahead * ahead.rotation[:, 2]
    swing = _swing(robot, q)
    least, most = views.tilt
    found = []
    for index in range(views.count):
        tilt = math.radians(least + (most - least) * math.sqrt((index + 0.5) / views.count))
        about = index * _GOLDEN
        lean = pin.exp3(tilt * np.array([math.cos(about), math.sin(about), 0.0]))
        turn = pin.exp3(np.array([0.0, 0.0, math.radians(views.rolls[index % len(views.rolls)])]))
        rotation = ahead.rotation @ lean @ turn
        place = middle - views.distances[index % len(views.distances)] * rotation[:, 2]
        start = q.copy()
        start[ARM_Q] += views.elbows[index % len(views.elbows)] * swing
        posture = _posture(robot, start, pin.SE3(rotation, place))
        if posture is None:
            continue
        there = q.copy()
        there[ARM_Q] = posture
        tool = robot.pose(there, robot.tool_id).translation
        if float((middle - tool) @ ahead.rotation[:, 2]) >= views.clear:
            found.append(posture)
    return _in_order(home, found)


def _swing(robot: RobotModel, q: Array) -> Array:
    """Direction of the arm's joints (7) that leaves the camera where it is, with 1 for the joint that turns most."""
    J = pin.computeFrameJacobian(robot.model, robot.data, q, robot.camera_id, pin.LOCAL)[:, ARM_Q]
    null = np.linalg.svd(J)[2][-1]
    out: Array = null / null[np.abs(null).argmax()]
    return out


def _posture(robot: RobotModel, start: Array, T_odom_camera: Any) -> Array | None:
    """Posture (7, rad) that brings the camera to a pose, from a configuration (12); None where there is none."""
    q = start.copy()
    limits = robot.limits.lower[ARM_Q] + _MARGIN, robot.limits.upper[ARM_Q] - _MARGIN
    for _ in range(_STEPS):
        off = pin.log6(robot.pose(q, robot.camera_id).actInv(T_odom_camera)).vector
        if float(np.abs(off).max()) < _SOLVED:
            return q[ARM_Q].copy()
        J = pin.computeFrameJacobian(robot.model, robot.data, q, robot.camera_id, pin.LOCAL)[:, ARM_Q]
        step = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(6), off)
        q[ARM_Q] = np.clip(q[ARM_Q] + step, *limits)
    return None


def _in_order(start: Array, postures: list[Array]) -> tuple[Array, ...]:
    """Always the nearest next."""
    left, here, out = list(postures), start, []
    while left:
        nearest = min(range(len(left)), key=lambda index: float(np.abs(left[index] - here).max()))
        here = left.pop(nearest)
        out.append(here)
    return tuple(out)


class CameraViews:
    """One round of pictures. Call `step` in each period until it is finished."""

    def __init__(
        self,
        config: ControllerConfig,
        follower: Follower,
        saturation: Saturation,
        close_ups: CloseUpClient,
        prefix: str,
        postures: tuple[Array, ...],
        refusal: Refusal,
    ) -> None:
        """Bind the parts.

        Args:
            config: Section `[controller]`.
            follower: Follower for motions of the arm.
            saturation: Braking to rest.
            close_ups: Client for the pictures.
            prefix: Of the names of the pictures.
            postures: Of `view_postures`.
            refusal: Why the arm cannot be in a posture (7, rad) from a configuration (12); None if it can.
        """
        self._config, self._follower, self._saturation = config, follower, saturation
        self._close_ups, self._refusal, self._dt = close_ups, refusal, 1.0 / config.rate_hz
        self._prefix = prefix
        self._left = list(enumerate(postures, 1))
        self._all, self._seen = len(postures), 0
        self._homing: Homing | None = Homing(config, follower, self._dt)
        self._way: ArmMotion | None = None
        self._timeout = MotionTimeout(config.work.reach_timeout_s, self._dt)
        self._goal = np.array(config.work.home)
        self._there_at: float | None = None
        self._number = 0
        self._asked = ""
        self._skipped: Reason | None = None
        # The row is everywhere: where it is not in a picture the next one may show it.
        self._first = None if prefix == CHECK else PictureAtRest(close_ups, f"{prefix}1")
        self._looked_from_home = prefix == CHECK

    def hold(self) -> None:
        """The robot stands for one period."""
        self._timeout.again()

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        if self._first is not None:
            return self._look_first(robot, self._first, now)
        if self._homing is not None:
            return self._home(robot, self._homing)
        if self._asked:
            return self._look(robot, now)
        if self._way is not None:
            return self._move(robot, self._way, now)
        if not self._left:
            self._homing = Homing(self._config, self._follower, self._dt)
            return StepResult(self._saturation.ramp(robot.sent))
        number, posture = self._left.pop(0)
        if (why := self._refusal(posture, robot.q)) is not None:
            self._skipped = why
            return StepResult(self._saturation.ramp(robot.sent))
        self._number, self._goal, self._there_at = number, posture, None
        self._way = ArmMotion(self._config.motion, robot.q[ARM_Q].copy(), posture)
        self._timeout.start(self._way.duration)
        return self._move(robot, self._way, now)

    def _look_first(self, robot: Measured, picture: PictureAtRest, now: float) -> StepResult:
        """A picture where the robot stands, and one more in the survey posture if it stood in another one."""
        xi, answer = self._saturation.ramp(robot.sent), picture.step(robot, now)
        if answer is None:
            return StepResult(xi)
        if answer.finding != "seen":
            return StepResult(xi, finished=True, summary=not_begun(answer))
        self._first = None
        off = float(np.abs(robot.q[ARM_Q] - np.array(self._config.work.home)).max())
        self._looked_from_home = self._homing is None or off < 2.0 * _NEAR
        return StepResult(xi)

    def _home(self, robot: Measured, homing: Homing) -> StepResult:
        """To the survey posture, before the first picture and after the last."""
        result = go_home(homing, robot, self._saturation, reasons.calibration_blocked)
        if homing.done:
            self._homing = None
            if not self._looked_from_home:
                self._first = PictureAtRest(self._close_ups, f"{self._prefix}1")
            elif not self._left:
                return StepResult(self._saturation.ramp(robot.sent), finished=True, summary=self._summary())
        return result

    def _move(self, robot: Measured, way: ArmMotion, now: float) -> StepResult:
        tracking = way.step(robot, self._follower, self._dt)
        self._timeout.note(tracking)
        self._timeout.over(tracking, now, 0.0)
        if self._timeout.late(now):
            # What holds the arm in one posture need not hold it on the way to the next.
            self._way, self._skipped = None, reasons.calibration_blocked(tracking.reason or UNNAMED)
        elif way.done and float(np.abs(robot.q[ARM_Q] - self._goal).max()) < _NEAR:
            self._there_at = now if self._there_at is None else self._there_at
            if now - self._there_at >= _REST_S:
                self._way, self._asked = None, f"{self._prefix}{self._number}"
                self._close_ups.ask(self._asked, "seen", now)
        return StepResult(tracking.xi)

    def _look(self, robot: Measured, now: float) -> StepResult:
        answer = self._close_ups.answer(self._asked, now)
        if answer is not None:
            self._seen += answer.finding == "seen"
            self._close_ups.forget(self._asked)
            self._asked = ""
        return StepResult(self._saturation.ramp(robot.sent))

    def _summary(self) -> Reason:
        if self._prefix == CHECK:
            return reasons.row_looked_at(self._seen, self._all)
        if self._seen == 0 and self._skipped is not None:
            return self._skipped
        return reasons.board_seen(self._seen, self._all) if self._seen else reasons.board_unseen(self._all)
