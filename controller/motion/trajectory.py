"""Tool trajectories and corrections of a goal.

Trajectories are straight: a quintic in normalised time along the SE(3) screw from start to goal.

Corrections to the paper's eqs. 13 and 14 stand in docs/paper.md: normalised time instead of the printed matrix, which
is singular at t_s = 0, and orientation by the logarithm.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from msgspec import Struct

from controller.whole_body.compiled import NOTHING, NUMBER, PACKED, VECTOR, compiled
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array

#: Peaks of s' , s'' and s''' of s = 10τ³ − 15τ⁴ + 6τ⁵ over τ in 0…1.
PEAK_VELOCITY, PEAK_ACCELERATION, PEAK_JERK = 1.875, 5.7735, 60.0


@dataclass(frozen=True)
class Rates:
    """Limits of velocity, acceleration and jerk along one distance, in the unit of the distance and seconds."""

    velocity: float
    acceleration: float
    jerk: float

    def duration(self, distance: float) -> float:
        """Shortest time (s) in which a quintic covers `distance` within the bounds."""
        d = abs(distance)
        return max(
            PEAK_VELOCITY * d / self.velocity,
            math.sqrt(PEAK_ACCELERATION * d / self.acceleration),
            math.cbrt(PEAK_JERK * d / self.jerk),
        )


class Progress(Struct, frozen=True):
    """Progress 0…1 along a motion, and its first two time derivatives (1/s, 1/s²)."""

    s: float
    rate: float
    acceleration: float


def quintic(time: float, duration: float) -> Progress:
    """The quintic from rest to rest at `time` (s) of `duration` (s); held before and after."""
    if duration <= 0.0 or time >= duration:
        return Progress(1.0, 0.0, 0.0)
    if time <= 0.0:
        return Progress(0.0, 0.0, 0.0)
    u = time / duration
    return Progress(
        u * u * u * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * u * u * (1.0 - u) ** 2 / duration,
        60.0 * u * (1.0 + u * (2.0 * u - 3.0)) / duration**2,
    )


def quintic_time(s: float) -> float:
    """Normalised time 0…1 at which the quintic reaches the progress `s`."""
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if quintic(middle, 1.0).s < s else (low, middle)
    return 0.5 * (low + high)


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
        self.duration = max(
            translation.duration(self.length),
            rotation.duration(float(np.linalg.norm(self._angular))),
            at_least,
            1e-3,
        )

    def at(self, time: float) -> ToolState:
        """Pose, twist and its rate at `time` (s) of the motion's own clock, in odom's axes."""
        progress = quintic(time, self.duration)
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
        at = quintic(time, self.duration)
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


@dataclass(frozen=True)
class Correction:
    """A straight shift of the rest of a motion.

    It is a quintic that begins and ends with zero velocity and acceleration. So its sum with the motion is continuous
    in position, velocity and acceleration, and ends at rest at the new goal.

    Attributes:
        begin: Start on the motion's clock (s).
        duration: Duration (s).
        by: Displacement (3, m, odom).
    """

    begin: float
    duration: float
    by: Array

    @classmethod
    def within(cls, begin: float, by: Array, rates: Rates) -> "Correction":
        """The shortest one within bounds of the tool's velocity, acceleration and jerk."""
        return cls(begin, max(rates.duration(float(np.linalg.norm(by))), 1e-3), by)

    @property
    def end(self) -> float:
        """When it has been made, on the motion's clock (s)."""
        return self.begin + self.duration

    def progress(self, time: float) -> Progress:
        """How much of it has been made at `time` (s)."""
        return quintic(time - self.begin, self.duration)
