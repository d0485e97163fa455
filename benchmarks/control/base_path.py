"""Motions of a differential drive between two poses: turn, drive, turn, with optional overlap.

With overlap the base turns while it drives, on an arc of changing curvature. The end pose then depends on turn and
distance together. Both are found by Newton's method on the exact arcs of the wheels in each control period. The base
drives forwards or backwards, whichever is faster.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.control.plan_limits import PlanLimits
from controller.motion.rest_to_rest import Profile, durations, quickest
from rolling_panda.model.differential_drive import Array, DifferentialDrive

_NEAR, _ITERATIONS, _NUDGE = 1e-11, 12, 1e-6
#: For shorter drives the base only turns (m).
_NO_DRIVE = 1e-9
#: Fractions of a turn that overlap with the drive.
_BLENDS = ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.0, 0.0))
_STRAIGHT = ((0.0, 0.0),)


@dataclass(frozen=True)
class BaseMotion:
    """A motion of the base from rest to rest, one row for each control period.

    Attributes:
        wheels: Rotation of the left and the right wheel in each period (T×2, rad).
        poses: Base poses [x, y, φ] (T+1×3) before the first and after each period; φ is continuous.
    """

    wheels: Array
    poses: Array

    @property
    def travel(self) -> float:
        """Length of the way of the reference point (m)."""
        return float(np.hypot(*np.diff(self.poses[:, :2], axis=0).T).sum())


class BasePlanner:
    """Plans motions between base poses within the limits."""

    def __init__(self, drive: DifferentialDrive, limits: PlanLimits) -> None:
        """Bind the wheels' geometry and the limits."""
        self._drive, self._limits = drive, limits

    def duration(self, start: Array, goals: Array) -> Array:
        """Time (N, s) to turn, drive and turn from a pose (3) to each of many (N×3), the quicker way, not blended."""
        delta = goals[:, :2] - start[:2]
        distance = np.hypot(delta[:, 0], delta[:, 1])
        bearing = np.arctan2(delta[:, 1], delta[:, 0])
        driving = durations(distance, self._limits.drive)
        ways = []
        for reverse in (0.0, math.pi):
            first = _size(bearing + reverse - start[2])
            second = _size(goals[:, 2] - bearing - reverse)
            ways.append(durations(first, self._limits.turn) + driving + durations(second, self._limits.turn))
        only_turn = durations(_size(goals[:, 2] - start[2]), self._limits.turn)
        best: Array = np.where(distance < _NO_DRIVE, only_turn, np.minimum(*ways))
        return best

    def motions(self, start: Array, goal: Array, blends: tuple[tuple[float, float], ...] = _BLENDS) -> list[BaseMotion]:
        """Motions from a base pose (3) to another (3), the quickest first.

        Args:
            start: Base pose.
            goal: Base pose.
            blends: Shares of the first and of the second turn that fall together with the drive, to be tried; without
                overlap, (0, 0), there always is a motion.
        """
        start, goal = self._axle(start, -1.0), self._axle(goal, -1.0)
        found = [motion for motion in self._ways(start, goal, blends) if motion is not None]
        return sorted(found, key=lambda motion: len(motion.wheels))

    def via(self, points: list[Array]) -> BaseMotion:
        """From pose to pose along straight lines, at rest at each, by the quickest motions that do not blend."""
        at, wheels, poses = points[0], [np.empty((0, 2))], [points[0][None]]
        for point in points[1:]:
            part = self.motions(at, point, _STRAIGHT)[0]
            at = part.poses[-1]
            wheels.append(part.wheels)
            poses.append(part.poses[1:])
        return BaseMotion(np.vstack(wheels), np.vstack(poses))

    def _ways(self, start: Array, goal: Array, blends: tuple[tuple[float, float], ...]) -> Iterator[BaseMotion | None]:
        dx, dy = goal[:2] - start[:2]
        distance = math.hypot(dx, dy)
        total = _wrap(goal[2] - start[2])
        if distance < _NO_DRIVE:
            still = quickest(0.0, self._limits.drive)
            yield self._finished(self._sampled(start, quickest(total, self._limits.turn), still, still, 0.0, 0.0))
            return
        for direction in (1.0, -1.0):
            first = _wrap(math.atan2(direction * dy, direction * dx) - start[2])
            second = _wrap(goal[2] - start[2] - first)
            for blend in blends:
                yield self._shoot(start, goal, first, direction * distance, first + second, blend)

    def _shoot(
        self, start: Array, goal: Array, first: float, distance: float, total: float, blend: tuple[float, float]
    ) -> BaseMotion | None:
        """Newton's method on the first turn and the distance, for the place; the heading fits by construction."""
        limits = self._limits

        def motion(x: Array) -> BaseMotion:
            return self._sampled(
                start,
                quickest(float(x[0]), limits.turn),
                quickest(float(x[1]), limits.drive),
                quickest(total - float(x[0]), limits.turn),
                *blend,
            )

        x = np.array([first, distance])
        tried = motion(x)
        error = tried.poses[-1, :2] - goal[:2]
        for _ in range(_ITERATIONS):
            if float(np.abs(error).max()) < _NEAR:
                return self._finished(tried)
            slope = np.empty((2, 2))
            for column in range(2):
                nudged = x.copy()
                nudged[column] += _NUDGE
                slope[:, column] = (motion(nudged).poses[-1, :2] - goal[:2] - error) / _NUDGE
            determinant = slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]
            if abs(determinant) < 1e-4:
                return None
            x[0] -= (slope[1, 1] * error[0] - slope[0, 1] * error[1]) / determinant
            x[1] -= (slope[0, 0] * error[1] - slope[1, 0] * error[0]) / determinant
            if abs(x[0] - first) > 1.2 or abs(x[1] - distance) > 0.5 * abs(distance) + 0.2:
                return None
            tried = motion(x)
            error = tried.poses[-1, :2] - goal[:2]
        return None

    def _sampled(
        self, start: Array, first: Profile, drive: Profile, second: Profile, overlap_in: float, overlap_out: float
    ) -> BaseMotion:
        """Rotation of the wheels in each period. A segment without overlap begins on a whole period."""
        dt = self._limits.dt
        lead = overlap_in * min(first.duration, drive.duration / 2.0)
        tail = overlap_out * min(second.duration, drive.duration / 2.0)
        t_drive = _grid(first.duration, dt) if overlap_in == 0.0 else first.duration - lead
        end = t_drive + drive.duration
        t_second = _grid(end, dt) if overlap_out == 0.0 else end - tail
        count = max(1, math.ceil((max(end, t_second + second.duration) - 1e-9) / dt))
        t: Array = dt * np.arange(count + 1, dtype=np.float64)
        heading = start[2] + first.at(t) + second.at(t - t_second)
        along = drive.at(t - t_drive)
        turned, driven = np.diff(heading), np.diff(along)
        chord = driven * np.sinc(turned / (2.0 * np.pi))
        middle = heading[:-1] + turned / 2.0
        poses = np.empty((count + 1, 3))
        poses[0, :2], poses[:, 2] = start[:2], heading
        poses[1:, 0] = start[0] + np.cumsum(chord * np.cos(middle))
        poses[1:, 1] = start[1] + np.cumsum(chord * np.sin(middle))
        R, mu = self._drive.wheel_radius, self._drive.half_track
        wheels = np.stack([driven - mu * turned, driven + mu * turned], axis=1) / R
        return BaseMotion(wheels, poses)

    def _finished(self, motion: BaseMotion) -> BaseMotion:
        poses = motion.poses.copy()
        poses[:, 0] += self._drive.rho * np.cos(poses[:, 2])
        poses[:, 1] += self._drive.rho * np.sin(poses[:, 2])
        return BaseMotion(motion.wheels, poses)

    def _axle(self, pose: Array, sign: float) -> Array:
        offset = sign * self._drive.rho
        return np.array([pose[0] + offset * np.cos(pose[2]), pose[1] + offset * np.sin(pose[2]), pose[2]])


def _size(angle: Array) -> Array:
    return np.abs(np.arctan2(np.sin(angle), np.cos(angle)))


def _wrap(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))


def _grid(time: float, dt: float) -> float:
    """The first whole period at or after a time."""
    return math.ceil(time / dt - 1e-9) * dt
