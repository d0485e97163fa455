"""Obstacles as capsules in odom: posts, wires, cordons, trunks and canes."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, PACKED, VECTOR, compiled
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array

Point = tuple[float, float, float]
_POINT = 1e-12


@dataclass(frozen=True)
class Obstacle:
    """A capsule in odom; with `start` equal to `end` it is a sphere.

    Attributes:
        name: Unique among the obstacles.
        kind: What it is: `post`, `wire`, `cordon`, `trunk`, `cane`, …; for people.
        start: One end of the axis (m).
        end: The other end (m).
        radius: (m).
    """

    name: str
    kind: str
    start: Point
    end: Point
    radius: float

    def __post_init__(self) -> None:
        """Refuse an invalid capsule.

        Raises:
            InputError: A coordinate or the radius is not finite, or the radius is not positive.
        """
        if not all(math.isfinite(v) for v in (*self.start, *self.end, self.radius)) or self.radius <= 0.0:
            raise InputError(
                f"obstacle {self.name!r} from {self.start} to {self.end} has radius {self.radius}; "
                "ends must be finite and the radius positive (m)"
            )


class Axes:
    """The axes of n obstacles as arrays, for the distances of many spheres from all of them at once."""

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Precompute the terms that do not depend on the spheres."""
        self._start = np.array([o.start for o in obstacles], dtype=np.float64).reshape(-1, 3)
        self._along = np.array([o.end for o in obstacles], dtype=np.float64).reshape(-1, 3) - self._start
        square = np.sum(self._along * self._along, axis=1)
        self._inverse = np.where(square > _POINT, 1.0 / np.maximum(square, _POINT), 0.0)
        self._radius = np.array([o.radius for o in obstacles], dtype=np.float64)

    def part(self, which: Any) -> "Axes":
        """Those of some of the obstacles (indices)."""
        out = Axes(())
        out._start, out._along = self._start[which], self._along[which]
        out._inverse, out._radius = self._inverse[which], self._radius[which]
        return out

    def ends(self, number: int) -> Array:
        """Both ends of one (2×3, m)."""
        return np.array([self._start[number], self._start[number] + self._along[number]])

    def away(self, place: Array) -> Array:
        """Distances of the n axes from a place (3, m)."""
        away: Array = self.gaps(place[None], np.zeros(1))[0] + self._radius
        return away

    def gaps(self, centers: Array, radii: Array) -> Array:
        """Gaps (g×n, m) between g spheres and the n obstacles; negative where they overlap."""
        gaps = np.empty((len(centers), len(self._start)))
        _gaps(centers, radii, self._start, self._along, self._inverse, self._radius, gaps)
        return gaps

    def capsule_gaps(self, first: Array, last: Array, radii: Array) -> Array:
        """Gaps (g×n, m) between g capsules with these ends (each g×3) and radii (g), and the n obstacles."""
        gaps = np.empty((len(radii), len(self._start)))
        _capsule_gaps(first, last, radii, self._start, self._along, self._radius, gaps)
        return gaps


@compiled(NOTHING(MATRIX, VECTOR, PACKED, PACKED, VECTOR, VECTOR, PACKED))
def _gaps(centers: Array, radii: Array, start: Array, along: Array, inverse: Array, radius: Array, gaps: Array) -> None:
    """Write |c − s − t a| less both radii, with t = (c − s)·a / a² inside 0…1; `inverse` is 1/a² (n)."""
    for g in range(len(radii)):
        for n in range(len(radius)):
            x, y, z = centers[g, 0] - start[n, 0], centers[g, 1] - start[n, 1], centers[g, 2] - start[n, 2]
            t = (x * along[n, 0] + y * along[n, 1] + z * along[n, 2]) * inverse[n]
            t = min(max(t, 0.0), 1.0)
            x, y, z = x - t * along[n, 0], y - t * along[n, 1], z - t * along[n, 2]
            gaps[g, n] = math.sqrt(x * x + y * y + z * z) - radii[g] - radius[n]


@compiled(NUMBER(NUMBER))
def _share(value: float) -> float:
    """The nearest number in 0…1."""
    return min(max(value, 0.0), 1.0)


@compiled(NOTHING(PACKED, PACKED, VECTOR, PACKED, PACKED, VECTOR, PACKED))
def _capsule_gaps(
    first: Array, last: Array, radii: Array, start: Array, along: Array, radius: Array, gaps: Array
) -> None:
    """Write the distances of line segments less both radii (Ericson, Real-Time Collision Detection, 5.1.9)."""
    for g in range(len(radii)):
        for n in range(len(radius)):
            u0, u1, u2 = last[g, 0] - first[g, 0], last[g, 1] - first[g, 1], last[g, 2] - first[g, 2]
            v0, v1, v2 = along[n, 0], along[n, 1], along[n, 2]
            w0, w1, w2 = first[g, 0] - start[n, 0], first[g, 1] - start[n, 1], first[g, 2] - start[n, 2]
            uu, vv, uv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2, u0 * v0 + u1 * v1 + u2 * v2
            uw, vw = u0 * w0 + u1 * w1 + u2 * w2, v0 * w0 + v1 * w1 + v2 * w2
            s, t = 0.0, 0.0
            if uu > _POINT and vv > _POINT:
                across = uu * vv - uv * uv
                s = _share((uv * vw - uw * vv) / across) if across > _POINT * uu * vv else 0.0
                t = (uv * s + vw) / vv
                if t < 0.0:
                    t, s = 0.0, _share(-uw / uu)
                elif t > 1.0:
                    t, s = 1.0, _share((uv - uw) / uu)
            elif uu > _POINT:
                s = _share(-uw / uu)
            elif vv > _POINT:
                t = _share(vw / vv)
            x, y, z = w0 + s * u0 - t * v0, w1 + s * u1 - t * v1, w2 + s * u2 - t * v2
            gaps[g, n] = math.sqrt(x * x + y * y + z * z) - radii[g] - radius[n]
