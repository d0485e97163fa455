"""The survey: a slow drive along the row with the arm in its survey posture, so that the camera sees every vine.

If undecided sites need another look at the end, the robot drives back once and takes more pictures. A Guyot vine is cut
from its head to past the eighth node: the camera is farther away on the way out, and nearer and low on the way back. An
operator can also send the robot to one undecided site: it takes pictures from both sides and from the front.
"""

import math

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import UNNAMED, Follower, Measured, Tracking
from controller.whole_body.saturation import Saturation
from controller.work.homing import Homing, go_home
from controller.work.point_queue import PointQueue
from controller.work.step_result import StepResult
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.model.differential_drive import NXI, Array

#: Deceleration of the base towards the end of the survey (m/s²), and tolerance of the end (m).
_BRAKING, _NEAR = 0.4, 0.005
#: Back to the line along the row: of the heading (1/s), and of the distance from it (1/m², times the speed squared).
_GAIN_HEADING, _GAIN_ASIDE = 1.2, 6.0
#: At the end of a way the pictures that were taken on it are waited for; beside a place one is taken at rest (s).
_PICTURES_S, _PICTURE_AT_REST_S = 0.6, 2.0
#: Where a place is looked at again from: so far beside it along the row (m), the camera before it once.
_SIDES = (-0.22, 0.0, 0.22)
#: What moves by less than this in the time (m, s) is held back by something.
_LEAST, _PATIENCE_S = 0.01, 3.0


class Survey:
    """One survey. Call `step` in each period until it is finished; stop calling it to stop the survey."""

    def __init__(
        self,
        config: ControllerConfig,
        follower: Follower,
        saturation: Saturation,
        queue: PointQueue,
        distance: float = 0.0,
        place: m.UndecidedSite | None = None,
    ) -> None:
        """Bind the parts.

        Args:
            config: Section `[controller]`.
            follower: Follower for motions of arm and base.
            saturation: Braking to rest.
            queue: The queue with perception's points.
            distance: Ahead along the row (m).
            place: The site to look at again, in place of a way along the row.
        """
        self._config, self._follower, self._saturation, self._queue = config, follower, saturation, queue
        #: Posture of the arm on the way (7, rad); None is the survey posture.
        self._posture: Array | None = None
        if queue.guyot and place is None:
            self._posture = np.array(config.work.survey_far)
        self._homing: Homing | None = self._to_posture()
        c, s = math.cos(config.work.row_heading), math.sin(config.work.row_heading)
        self._along, self._left = np.array([c, s]), np.array([-s, c])
        self._distance, self._place = distance, place
        self._line: tuple[float, float] | None = None
        self._goal = 0.0
        self._stops: list[float] = []
        self._again = self._place is not None
        self._there_at: float | None = None
        self._moved: tuple[float, float] | None = None

    def hold(self) -> None:
        """The robot stands for one period; that is no obstacle."""
        self._moved = None

    def go_on(self) -> None:
        """Go on after an interruption, wherever the arm is now. The way stays the same."""
        self._homing, self._there_at, self._moved = self._to_posture(), None, None

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        if self._homing is not None:
            result = go_home(self._homing, robot, self._saturation, reasons.survey_blocked)
            if self._homing.done:
                self._homing = None
            return result
        base = robot.in_map(robot.q)[:3]
        x, aside = float(base[:2] @ self._along), float(base[:2] @ self._left)
        if self._line is None:
            self._line = x, aside
            self._stops = self._waypoints(robot, x)
            self._goal = self._stops.pop(0)
        if abs(self._goal - x) > _NEAR and self._there_at is None:
            return self._drive(robot, x, aside - self._line[1], float(base[2]), now)
        return self._wait(robot, now)

    def _to_posture(self) -> Homing:
        return Homing(self._config, self._follower, 1.0 / self._config.rate_hz, self._posture)

    def _drive(self, robot: Measured, x: float, aside: float, heading: float, now: float) -> StepResult:
        left = self._goal - x
        speed = math.copysign(min(self._config.work.survey_speed, math.sqrt(2.0 * _BRAKING * abs(left))), left)
        turned = math.remainder(heading - self._config.work.row_heading, math.tau)
        turning = -_GAIN_HEADING * turned - _GAIN_ASIDE * speed * aside
        xi = np.zeros(NXI)
        xi[:2] = wheels(robot, speed, turning)
        tracking: Tracking = self._follower.jog(xi, robot)
        if self._moved is None or abs(x - self._moved[0]) > _LEAST:
            self._moved = x, now
        elif now - self._moved[1] > _PATIENCE_S:
            why = reasons.survey_blocked(tracking.reason or UNNAMED)
            return StepResult(self._saturation.ramp(robot.sent), pause=why)
        return StepResult(tracking.xi)

    def _wait(self, robot: Measured, now: float) -> StepResult:
        xi = self._saturation.ramp(robot.sent)
        if self._there_at is None:
            self._there_at = now
        if now - self._there_at < (_PICTURES_S if self._place is None else _PICTURE_AT_REST_S):
            return StepResult(xi)
        if self._stops:
            self._goal, self._there_at, self._moved = self._stops.pop(0), None, None
            return StepResult(xi)
        if self._line is not None and not self._again and self._unclear() > 0:
            self._again, self._goal, self._there_at, self._moved = True, self._line[0], None, None
            if self._queue.guyot:
                self._posture = np.array(self._config.work.survey_low)
                self._homing = self._to_posture()
            return StepResult(xi, events=(reasons.survey_returns(self._unclear()),))
        return StepResult(xi, finished=True, summary=self._summary())

    def _waypoints(self, robot: Measured, x: float) -> list[float]:
        """Where the base goes along the row (m), one after the other: the near side of a place first."""
        if self._place is None or self._place.position is None:
            return [x + self._distance]
        # The arm is home: the camera is at the tool, so far ahead of the base.
        ahead = float(robot.frame.pose_in_map(robot.kinematics.T_odom_tool).translation[:2] @ self._along) - x
        before = float(np.array(self._place.position)[:2] @ self._along) - ahead
        stops = [before + side for side in _SIDES]
        return stops if abs(stops[0] - x) <= abs(stops[-1] - x) else stops[::-1]

    def _unclear(self) -> int:
        perceived = self._queue.perceived
        return 0 if perceived is None else sum(each.needs == "another look" for each in perceived.undecided_sites)

    def _summary(self) -> m.Reason:
        perceived = self._queue.perceived
        if perceived is None:
            return reasons.survey_blind()
        if self._place is not None:
            return looked_again(perceived, self._place)
        named = [(point.vine, point.spur) for point in perceived.points]
        named += [(each.vine, each.spur) for each in perceived.undecided_sites if each.vine > 0]
        vines, spurs = len({vine for vine, _ in named}), len(set(named))
        asking = sum(each.needs == "operator" for each in perceived.undecided_sites)
        return reasons.surveyed(vines, spurs, len(perceived.points), self._unclear(), asking)


def open_place(perceived: m.PruningPoints | None, vine: int, spur: int) -> m.UndecidedSite | None:
    """A place that is open and was seen somewhere, by its spur; None where there is none."""
    left = () if perceived is None else perceived.undecided_sites
    found = [each for each in left if (each.vine, each.spur) == (vine, spur) and each.position is not None]
    return next((each for each in found if each.needs == "another look"), found[0] if found else None)


def looked_again(perceived: m.PruningPoints, place: m.UndecidedSite) -> m.Reason:
    """Result of a site."""
    left = open_place(perceived, place.vine, place.spur)
    shown = [point.point_id for point in perceived.points if (point.vine, point.spur) == (place.vine, place.spur)]
    if left is None and not shown:
        return reasons.looked_again_without_point(place.vine, place.spur)
    if left is None:
        return reasons.looked_again(place.vine, place.spur, ", ".join(shown))
    made = reasons.looked_again_asks if left.needs == "operator" else reasons.looked_again_unclear
    return made(place.vine, place.spur, left.reason)


def wheels(robot: Measured, speed: float, turning: float) -> Array:
    """Wheel velocities (2, rad/s) that give the base a forward speed (m/s) and a yaw rate (rad/s)."""
    S, heading = robot.kinematics.S, float(robot.q[2])
    forward = math.cos(heading) * S[0, :2] + math.sin(heading) * S[1, :2]
    out: Array = np.linalg.solve(np.stack([forward, S[2, :2]]), np.array([speed, turning]))
    return out
