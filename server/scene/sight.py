"""Where to look at a point from, so that the arm does not hide it."""

import math
from collections.abc import Sequence

import numpy as np

from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array

#: Places along a line of sight at which it is checked, and the first part of it that is not (m): there are the blades.
_SAMPLES, _NEAR_POINT = 24, 0.1
#: A line of sight has to pass the robot by so much (m).
_ROOM = 0.03


def blocked(eye: Array, point: Array, rods: Sequence[Capsule]) -> float:
    """How far rods reach into the line of sight from `eye` to `point` (m); 0 where it is free."""
    away = eye - point
    length = float(np.linalg.norm(away))
    if not rods or length <= _NEAR_POINT:
        return 0.0
    samples = point + away * np.linspace(_NEAR_POINT / length, 1.0, _SAMPLES)[:, None]
    start, end = (np.array([getattr(rod, name) for rod in rods]) for name in ("start", "end"))
    radius = np.array([max(rod.start_radius, rod.end_radius) for rod in rods])
    axis = end - start
    square = np.maximum((axis * axis).sum(axis=1), 1e-12)
    offset = samples[:, None] - start[None]
    fraction = np.clip((offset * axis[None]).sum(axis=2) / square, 0.0, 1.0)
    gap = np.linalg.norm(offset - fraction[..., None] * axis[None], axis=2) - radius
    return max(0.0, _ROOM - float(gap.min()))


def clear_direction(
    point: Array, distance: float, wanted: Array, directions: Sequence[Array], rods: Sequence[Capsule]
) -> Array:
    """The direction nearest to `wanted` (3, unit, from the point to the camera) from which no rod hides the point.

    Where all are hidden, the one that is hidden least.

    Args:
        point: To look at (3, m).
        distance: Of the camera from it (m).
        wanted: Is taken if it is free.
        directions: The others (3 each, unit).
        rods: What hides.
    """

    def cost(direction: Array) -> float:
        angle = math.acos(min(max(float(direction @ wanted), -1.0), 1.0))
        return 100.0 * blocked(point + distance * direction, point, rods) + angle

    return min((wanted, *directions), key=cost)


def directions(azimuths: Sequence[float], elevations: Sequence[float], turn: Array) -> list[Array]:
    """Unit vectors (3) at these angles (rad) about and above the ground, from the x axis of `turn` (3×3)."""
    return [
        turn
        @ np.array(
            [
                math.cos(elevation) * math.cos(azimuth),
                math.cos(elevation) * math.sin(azimuth),
                math.sin(elevation),
            ]
        )
        for azimuth in azimuths
        for elevation in elevations
    ]
