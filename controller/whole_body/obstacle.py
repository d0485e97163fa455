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


@dataclass(frozen=True)
class Axes:
    """The axes of n obstacles as arrays.

    Attributes:
        start: (n×3, m).
        along: From start to end (n×3, m).
        inverse_square: 1/|along|² (n), 0 for spheres.
        radius: (n, m).
    """

    start: Array
    along: Array
    inverse_square: Array
    radius: Array

    def gaps(self, centers: Array, radii: Array) -> Array:
        """Gaps (g×n, m) between g spheres and the n obstacles; negative where they overlap."""
        offset = centers[:, None, :] - self.start
        t = np.clip(np.einsum("gnk,nk->gn", offset, self.along) * self.inverse_square, 0.0, 1.0)
        offset -= t[:, :, None] * self.along
        gaps: Array = np.sqrt(np.einsum("gnk,gnk->gn", offset, offset)) - radii[:, None] - self.radius
        return gaps


def axes(obstacles: tuple[Obstacle, ...]) -> Axes:
    """The obstacles' axes."""
    start = np.array([o.start for o in obstacles], dtype=np.float64).reshape(-1, 3)
    along = np.array([o.end for o in obstacles], dtype=np.float64).reshape(-1, 3) - start
    square = np.einsum("nk,nk->n", along, along)
    inverse = np.where(square > _POINT, 1.0 / np.maximum(square, _POINT), 0.0)
    return Axes(start, along, inverse, np.array([o.radius for o in obstacles], dtype=np.float64))
