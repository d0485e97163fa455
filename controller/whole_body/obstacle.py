"""What stands beside the robot: posts, wires, cordon, trunks and canes as capsules in odom."""

import math
from dataclasses import dataclass

import numpy as np

from rolling_panda.differential_drive import Array
from rolling_panda.errors import InputError

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
        """Refuse what is no capsule.

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
        """Precompute what does not depend on the spheres."""
        start = np.array([o.start for o in obstacles], dtype=np.float64).reshape(-1, 3)
        along = np.array([o.end for o in obstacles], dtype=np.float64).reshape(-1, 3) - start
        self._square = np.sum(along * along, axis=1)
        self._inverse = np.where(self._square > _POINT, 1.0 / np.maximum(self._square, _POINT), 0.0)
        self._start_T, self._along_T = start.T.copy(), along.T.copy()
        self._offset, self._from_origin = np.sum(start * along, axis=1), np.sum(start * start, axis=1)
        self._radius = np.array([o.radius for o in obstacles], dtype=np.float64)

    def gaps(self, centers: Array, radii: Array) -> Array:
        """Gaps (g×n, m) between g spheres and the n obstacles; negative where they overlap."""
        # |c − s − t a|² with t = (c − s)·a / a², written out so that it takes two products of small matrices.
        shadow = centers @ self._along_T - self._offset
        t = np.minimum(np.maximum(shadow * self._inverse, 0.0), 1.0)
        square = np.sum(centers * centers, axis=1)[:, None] - 2.0 * (centers @ self._start_T) + self._from_origin
        square += t * (t * self._square - 2.0 * shadow)
        gaps: Array = np.sqrt(np.maximum(square, 0.0)) - radii[:, None] - self._radius
        return gaps
