"""Straight motions of the tool: a quintic in normalised time along the SE(3) screw from start to goal.

Corrections to the paper's eqs. 13 and 14 stand in docs/paper.md: normalised time instead of the printed matrix, which
is singular at t_s = 0, and orientation by the logarithm.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rolling_panda.differential_drive import Array

#: Peaks of s' , s'' and s''' of s = 10τ³ − 15τ⁴ + 6τ⁵ over τ in 0…1.
PEAK_VELOCITY, PEAK_ACCELERATION, PEAK_JERK = 1.875, 5.7735, 60.0


@dataclass(frozen=True)
class Rates:
    """Bounds of a motion over one kind of distance: velocity, acceleration and jerk in that unit and seconds."""

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


@dataclass(frozen=True)
class Progress:
    """Share of a motion done, 0…1, and its first two derivatives by time (1/s, 1/s²)."""

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
    """The share of the duration, 0…1, after which the quintic has come to the share `s` of its way."""
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if quintic(middle, 1.0).s < s else (low, middle)
    return 0.5 * (low + high)


@dataclass(frozen=True)
class ToolState:
    """Where the tool should be (T_odom_tool, pin.SE3), and its twist [v; ω] (6) at the tool with its rate (6)."""

    T_odom_tool: Any
    twist: Array
    acceleration: Array


class PoseTrajectory:
    """From one tool pose to another, at rest at both ends: along a screw, or `straight` with the turn alongside."""

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
            rotation: Bounds of its turning (rad).
            at_least: Shortest duration (s), for what else has to move in that time.
            straight: True for the straight line between the origins. A screw with a turn bulges sideways by about an
                eighth of length times turn, which over a long way is more than the distance kept from the canes.
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

    def _placement(self, s: float) -> Any:
        if self._straight:
            turn = pin.exp3(self._angular * s)
            return pin.SE3(self.start.rotation @ turn, self.start.translation + s * self._linear)
        return self.start * pin.exp6(pin.Motion(self._linear * s, self._angular * s))
