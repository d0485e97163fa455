"""Tool trajectories, corrections of a goal, and the motion of overlapping straight segments with their postures.

Trajectories are straight: from start to goal along the SE(3) screw, as fast as velocity, acceleration and jerk allow.

Corrections to the paper's eqs. 13 and 14 stand in docs/paper.md: normalised time instead of the printed matrix, which
is singular at t_s = 0, and orientation by the logarithm.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from msgspec import Struct

from controller.config import MotionConfig, WholeBodyConfig
from controller.motion.rest_to_rest import Profile, Progress, Rates, quickest, together
from controller.whole_body.compiled import NOTHING, NUMBER, PACKED, VECTOR, compiled
from controller.whole_body.task import BaseMode, Posture
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q


class ToolState(Struct, frozen=True):
    """Desired tool pose (T_odom_tool, pin.SE3), its twist [v; ω] (6) at the tool, and the twist's rate (6)."""

    T_odom_tool: Any
    twist: Array
    acceleration: Array


class PoseTrajectory:
    """Trajectory between two tool poses at rest: along a screw, or `straight` with a separate rotation."""

    def __init__(
        self,
        start: Any,
        goal: Any,
        translation: Rates,
        rotation: Rates,
        at_least: float = 0.0,
        straight: bool = False,
        others: Sequence[tuple[float, Rates]] = (),
    ) -> None:
        """Plan.

        Args:
            start: T_odom_tool (pin.SE3) at the beginning.
            goal: T_odom_tool (pin.SE3) at the end.
            translation: Bounds of the tool's origin (m).
            rotation: Bounds of the tool's rotation (rad).
            at_least: Shortest duration (s), for other motions in that time.
            straight: True for the straight line between the origins. A screw with a turn bulges sideways by about an
                eighth of length times rotation. Over a long distance that exceeds the clearance from the canes.
            others: Distances that are covered in the same time, with their bounds.
        """
        self.start, self.goal = start, goal
        self._straight = straight
        if straight:
            self._linear = goal.translation - start.translation
            self._angular = pin.log3(start.rotation.T @ goal.rotation)
        else:
            screw = pin.log6(start.actInv(goal))
            self._linear, self._angular = screw.linear, screw.angular
        self.length = float(np.linalg.norm(self._linear))
        # Along a screw, the tool's origin moves at the length of the body's linear velocity: the length of its arc.
        turn = float(np.linalg.norm(self._angular))
        self._law = quickest(1.0, together((self.length, translation), (turn, rotation), *others))
        self.duration = max(self._law.duration, at_least, 1e-3)

    def progress(self, time: float) -> Progress:
        """How far it is at `time` (s) of the motion's own clock."""
        return self._law.over(time, self.duration)

    def when(self, s: float) -> float:
        """When it has come as far as `s` (s)."""
        return self.duration * self._law.when(s)

    def at(self, time: float) -> ToolState:
        """Pose, twist and its rate at `time` (s) of the motion's own clock, in odom's axes."""
        progress = self.progress(time)
        placement = self._placement(progress.s)
        if progress.rate == 0.0:
            return ToolState(placement, np.zeros(6), np.zeros(6))
        R = placement.rotation
        linear = self._linear if self._straight else R @ self._linear
        angular = R @ self._angular
        way = np.concatenate([linear, angular])
        acceleration = way * progress.acceleration
        if not self._straight:
            # Along a screw the velocity turns with the tool.
            acceleration[:3] += np.cross(angular, linear) * progress.rate**2
        return ToolState(placement, way * progress.rate, acceleration)

    def add(self, time: float, position: Array, R: Array, twist: Array, acceleration: Array) -> None:
        """Add the displacement of a straight motion at `time` (s) to another motion.

        Args:
            time: Time on this motion's clock (s).
            position: Position of the tool (3) without this motion; changed.
            R: Rotation of the tool (3×3); changed.
            twist: Twist of the tool (6); changed.
            acceleration: Rate of the twist (6); changed.

        Raises:
            InputError: The motion is not straight.
        """
        if not self._straight:
            raise InputError("a motion along a screw cannot be carried along; plan it with straight=True")
        at = self.progress(time)
        _add(self._linear, self._angular, at.s, at.rate, at.acceleration, position, R, twist, acceleration)

    def _placement(self, s: float) -> Any:
        if self._straight:
            turn = pin.exp3(self._angular * s)
            return pin.SE3(self.start.rotation @ turn, self.start.translation + s * self._linear)
        return self.start * pin.exp6(pin.Motion(self._linear * s, self._angular * s))


@compiled(NOTHING(VECTOR, VECTOR, NUMBER, NUMBER, NUMBER, VECTOR, PACKED, VECTOR, VECTOR))
def _add(
    linear: Array,
    angular: Array,
    s: float,
    rate: float,
    acceleration: float,
    position: Array,
    R: Array,
    twist: Array,
    change: Array,
) -> None:
    """See `PoseTrajectory.add`: position += s · linear, R ← R exp(s · angular), and the derivatives of both.

    The axis is R · angular throughout, and turns with what carries it: its rate is ω × (R · angular).
    """
    axis, turning = np.zeros(3), np.zeros(3)
    angle = s * math.sqrt(angular[0] ** 2 + angular[1] ** 2 + angular[2] ** 2)
    # exp(a) = 1 + sin α/α [a] + (1 − cos α)/α² [a]², with its limits at no turn (Rodrigues).
    first = math.sin(angle) / angle if angle > 1e-9 else 1.0
    second = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 1e-9 else 0.5
    for i in range(3):
        axis[i] = R[i, 0] * angular[0] + R[i, 1] * angular[1] + R[i, 2] * angular[2]
        turning[i] = rate * axis[i]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        change[i] += acceleration * linear[i]
        change[3 + i] += acceleration * axis[i] + twist[3 + j] * turning[k] - twist[3 + k] * turning[j]
    for i in range(3):
        position[i] += s * linear[i]
        twist[i] += rate * linear[i]
        twist[3 + i] += turning[i]
        # Rows of R times [a] are their cross products with a.
        x, y, z = R[i, 0], R[i, 1], R[i, 2]
        a, b, c = s * angular[0], s * angular[1], s * angular[2]
        once = (y * c - z * b, z * a - x * c, x * b - y * a)
        R[i, 0] += first * once[0] + second * (once[1] * c - once[2] * b)
        R[i, 1] += first * once[1] + second * (once[2] * a - once[0] * c)
        R[i, 2] += first * once[2] + second * (once[0] * b - once[1] * a)


@dataclass(frozen=True, eq=False)
class Correction:
    """A straight shift of the rest of a motion.

    It begins and ends with zero velocity and acceleration. So its sum with the motion is continuous in position,
    velocity and acceleration, and ends at rest at the new goal.

    Attributes:
        begin: Start on the motion's clock (s).
        law: How much of it has been made when.
        by: Displacement of the tool (3, m, odom).
        base: Displacement of the base (2, m, odom).
    """

    begin: float
    law: Profile
    by: Array
    base: Array

    @classmethod
    def within(cls, begin: float, by: Array, base: Array, rates: Rates) -> "Correction":
        """The shortest one within bounds of the tool's velocity, acceleration and jerk."""
        return cls(begin, quickest(max(float(np.linalg.norm(by)), _LEAST), rates), by, base)

    @property
    def end(self) -> float:
        """When it has been made, on the motion's clock (s)."""
        return self.begin + self.law.duration

    def progress(self, time: float) -> Progress:
        """How much of it has been made at `time` (s)."""
        return self.law.progress(time - self.begin)


#: A correction is of no less (m).
_LEAST = 1e-9
#: Assumed limits of the arm's joints for a segment (rad/s, rad/s², rad/s³), with margin for feedback.
_ARM = tuple(
    Rates(v, a, 60.0) for v, a in zip((1.3,) * 4 + (1.5,) * 3, (6.0, 3.0, 4.0, 5.0, 6.0, 8.0, 8.0), strict=True)
)
#: A displacement of the base (2, m) that is none.
_STAYS: Array = np.zeros(2)
#: Tolerance of the base's duration (s).
_ROOM_S = 0.02


@dataclass(frozen=True)
class Leg:
    """A straight segment of a tool motion.

    Attributes:
        goal: T_odom_tool at its end (pin.SE3).
        q_goal: Desired configuration (12) at its end, for the null space.
        speed: Largest tool speed (m/s).
        frozen_within: Distance to the goal within which only the arm moves (m); infinite for the whole segment.
        frozen_until: Distance from the start up to which only the arm moves (m).
    """

    goal: Any
    q_goal: Array
    speed: float
    frozen_within: float = 0.0
    frozen_until: float = 0.0


@dataclass(frozen=True)
class _Timed:
    """A segment from rest to rest that starts at `begin` (s)."""

    begin: float
    trajectory: PoseTrajectory
    span: Array
    leg: Leg

    @property
    def end(self) -> float:
        return self.begin + self.trajectory.duration

    def free(self, until: float) -> tuple[float, float] | None:
        """When the base may move (s), `until` at the latest; None when it may not."""
        length, arm_until, within = self.trajectory.length, self.leg.frozen_until, self.leg.frozen_within
        begin, end, duration = self.begin, self.end, self.trajectory.duration
        if arm_until + within > 0.0:
            if arm_until + within >= length:
                return None
            begin += self.trajectory.when(arm_until / length)
            end -= duration - self.trajectory.when(1.0 - within / length)
        return (begin, min(end, until)) if begin < min(end, until) else None


class ToolMotion:
    """A sequence of segments. A segment begins while the previous one still decelerates.

    Each segment goes from rest to rest. Where two overlap, their motions add up: the tool rounds the corner without
    stopping, with continuous velocity and acceleration. The base goes from rest to rest as well, from the first to the
    last time at which it may move. The clock of the motion advances as fast as the limits allow.
    """

    def __init__(
        self,
        config: MotionConfig,
        limits: WholeBodyConfig,
        start: Any,
        q_start: Array,
        legs: Sequence[Leg],
        slow_end: bool = False,
        free_axis: bool = False,
        flows: bool = True,
        waits: bool = False,
    ) -> None:
        """Plan.

        Args:
            config: Speeds and accelerations of the tool.
            limits: Of the base.
            start: T_odom_tool at the beginning (pin.SE3).
            q_start: Configuration (12) at the beginning.
            legs: At least one.
            slow_end: True for the motion to a cut: the last `slow_zone` is at `cut_speed`.
            free_axis: True leaves the rotation about the tool's y free.
            flows: False ends every segment at rest before the next one begins.
            waits: True if the motion may wait at its end for an extension; the base may still move then.
        """
        self._config, self._slow_end, self.free_axis = config, slow_end, free_axis
        self._flows, self._waits_until = flows, math.inf if waits and flows else 0.0
        self._start, self._q_start, self._legs = start, q_start, _timed(config, limits, start, q_start, legs, flows)
        self.goal, self.q_goal, self.speed = legs[-1].goal, legs[-1].q_goal, max(leg.speed for leg in legs)
        self._goal_place = self.goal.translation.tolist()
        self._free = _free(self._legs)
        self._base_span = self.q_goal[:2] - q_start[:2]
        self._drive = _drive(limits, self._base_span)
        self.legs = len(legs)
        self.duration = max(leg.end for leg in self._legs)
        self.time, self.scale = 0.0, 1.0
        self._corrections: list[Correction] = []
        self._settled: Posture | None = None

    @property
    def done(self) -> bool:
        """True when the clock has reached the end."""
        return self.time >= self.duration

    @property
    def correcting(self) -> bool:
        """Whether the last shift of the goal is still being made."""
        return bool(self._corrections) and self.time < self._corrections[-1].end

    @property
    def leg(self) -> int:
        """Number of the leg that has begun last."""
        return max(i for i, leg in enumerate(self._legs) if i == 0 or self.time >= leg.begin)

    @property
    def base(self) -> BaseMode:
        """Current role of the base."""
        if self._free is None:
            return "frozen"
        return "row" if self._free[0] <= self.time < max(self._free[1], self._waits_until) else "frozen"

    def extend(self, leg: Leg) -> None:
        """Append a segment to a cut, with the base at its current goal. It blends into the rest of the last segment.

        Args:
            leg: Its end is the new goal. The last `slow_zone` is slow.
        """
        config, last = self._config, self._legs[-1]
        made = _placed(config, self.goal, last.leg.q_goal, [leg], self._flows, None, 0.0)[0]
        begin = last.end
        if self._flows:
            begin -= config.blend * min(last.trajectory.duration, made.trajectory.duration)
        made = replace(made, begin=max(begin, self.time))
        self._legs = (*self._legs, made)
        free = made.free(math.inf)
        self._waits_until = 0.0 if free is None else free[1]
        self.goal, self.q_goal, self.speed = leg.goal, leg.q_goal, max(self.speed, leg.speed)
        self._goal_place, self._slow_end = leg.goal.translation.tolist(), True
        self.legs, self.duration = len(self._legs), max(self.duration, made.end)

    def shift(self, by: Array, base: Array = _STAYS) -> None:
        """Move the goal from now on, without a jump of velocity or acceleration.

        Args:
            by: Displacement of the tool's goal (3, m, odom).
            base: Displacement of the base's goal (2, m, odom), where the base moves.
        """
        config = self._config
        # At the speed of the last part, so that a late correction does not accelerate the blades.
        rates = Rates(config.cut_speed, config.tool_acceleration, config.tool_jerk)
        made = Correction.within(self.time, by, base, rates)
        self._keep_ended()
        self._corrections.append(made)
        self.goal = pin.SE3(self.goal.rotation, self.goal.translation + by)
        self.q_goal = self.q_goal.copy()
        self.q_goal[:2] += base
        self.duration = max(self.duration, made.end)

    def _keep_ended(self) -> None:
        """Corrections that have been made become part of where the motion began: uneven ground asks for many."""
        for each in [each for each in self._corrections if each.end <= self.time]:
            self._corrections.remove(each)
            self._start = pin.SE3(self._start.rotation, self._start.translation + each.by)
            if self._free is not None:
                self._q_start = self._q_start + np.pad(each.base, (0, len(self._q_start) - 2))

    def settle(self, q: Array) -> None:
        """Hold the tool at its desired pose, with the arm posture of q (12); effective once."""
        if self._settled is None:
            self._settled = Posture(q.copy())

    def advance(self, scale: float, dt: float) -> None:
        """Let the clock run at the rate `scale` for one period of `dt` (s)."""
        self.scale = scale
        self.time += dt * scale

    def desired(self) -> ToolState:
        """Where the tool should be now, its twist and the rate of that."""
        return self._state(self.time)

    def ahead(self, seconds: float) -> Any:
        """Where the tool should be so much later on the motion's clock (T_odom_tool, pin.SE3)."""
        return self._state(min(self.time + seconds, self.duration)).T_odom_tool

    def _state(self, time: float) -> ToolState:
        position, R = self._start.translation.copy(), np.array(self._start.rotation, order="C")
        twist, acceleration = np.zeros(6), np.zeros(6)
        for leg in self._legs:
            if time <= leg.begin:
                break
            leg.trajectory.add(time - leg.begin, position, R, twist, acceleration)
        for made in self._corrections:
            done = made.progress(time)
            position += done.s * made.by
            twist[:3] += done.rate * made.by
            acceleration[:3] += done.acceleration * made.by
        return ToolState(pin.SE3(R, position), twist, acceleration)

    def posture(self) -> Posture:
        """Base and arm as they should be now: the arm straight from leg to leg, heading as at the goal."""
        if self._settled is not None:
            return self._settled
        q, rate = self._q_start.copy(), np.zeros(len(self._q_start))
        for leg in self._legs:
            if self.time <= leg.begin:
                break
            progress = leg.trajectory.progress(self.time - leg.begin)
            _go_along(leg.span, progress.s, progress.rate, q, rate)
        if self._free is None:
            q[:2], rate[:2] = self._q_start[:2], 0.0
        else:
            progress = self._drive.over(self.time - self._free[0], self._free[1] - self._free[0])
            q[:2] = self._q_start[:2] + self._base_span * progress.s
            rate[:2] = self._base_span * progress.rate
            for made in self._corrections:
                _go_along(made.base, (done := made.progress(self.time)).s, done.rate, q, rate)
        q[2], rate[2] = self.q_goal[2], 0.0
        return Posture(q, rate, self.q_goal)

    def cap(self, T_odom_tool: Any) -> float:
        """Largest tool speed (m/s) at this tool pose."""
        if not self._slow_end:
            return self.speed * 1.2
        config = self._config
        away = math.dist(self._goal_place, T_odom_tool.translation.tolist()) - config.slow_zone
        return math.sqrt(config.cut_speed**2 + 2.0 * config.slow_braking * max(away, 0.0))


@compiled(NOTHING(VECTOR, NUMBER, NUMBER, VECTOR, VECTOR))
def _go_along(span: Array, s: float, rate: float, q: Array, q_rate: Array) -> None:
    """Add s · span to the first of q and rate · span to its rate (12 each)."""
    for i in range(len(span)):
        q[i] += s * span[i]
        q_rate[i] += rate * span[i]


def _timed(
    config: MotionConfig, limits: WholeBodyConfig, start: Any, q_start: Array, legs: Sequence[Leg], flows: bool
) -> tuple[_Timed, ...]:
    """The legs in their places, with time enough for the base between them."""
    base_s = _drive(limits, legs[-1].q_goal[:2] - q_start[:2]).duration
    # The segment that waits for the base: there the line of the tool matters least.
    waits = next((i for i, leg in enumerate(legs) if leg.frozen_until == leg.frozen_within == 0.0), None)
    extra = 0.0
    while True:
        timed = _placed(config, start, q_start, legs, flows, waits, extra)
        free = _free(timed)
        if waits is None or free is None or free[1] - free[0] >= base_s - _ROOM_S:
            return timed
        # A longer segment overlaps more with its neighbours, so this converges from below.
        extra = timed[waits].trajectory.duration + base_s - (free[1] - free[0])


def _drive(limits: WholeBodyConfig, span: Array) -> Profile:
    """The quickest motion of the base over its span (2, m), with margin for feedback."""
    rates = Rates(0.8 * limits.base_speed, 0.75 * limits.base_acceleration, 10.0)
    return quickest(math.hypot(*span.tolist()), rates)


def _placed(
    config: MotionConfig,
    start: Any,
    q_start: Array,
    legs: Sequence[Leg],
    flows: bool,
    waits: int | None,
    at_least: float,
) -> tuple[_Timed, ...]:
    out: list[_Timed] = []
    for number, leg in enumerate(legs):
        span = leg.q_goal - q_start
        trajectory = PoseTrajectory(
            start,
            leg.goal,
            Rates(leg.speed, config.tool_acceleration, config.tool_jerk),
            Rates(config.tool_turn, 3.0 * config.tool_acceleration, 3.0 * config.tool_jerk),
            at_least if number == waits else 0.0,
            straight=True,
            others=tuple(zip(span[ARM_Q].tolist(), _ARM, strict=True)),
        )
        begin = 0.0
        if out:
            before = out[-1]
            begin = before.end
            if flows:
                begin -= config.blend * min(before.trajectory.duration, trajectory.duration)
        out.append(_Timed(begin, trajectory, span, leg))
        start, q_start = leg.goal, leg.q_goal
    return tuple(out)


def _free(legs: tuple[_Timed, ...]) -> tuple[float, float] | None:
    """Start and end of the base's motion (s). In an overlap the later segment decides."""
    ends = (*(leg.begin for leg in legs[1:]), math.inf)
    times = [free for leg, end in zip(legs, ends, strict=True) if (free := leg.free(end)) is not None]
    return (times[0][0], times[-1][1]) if times else None
