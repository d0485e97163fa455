"""How far a cut is from what the blades must not touch."""

import numpy as np

from perception.plant.model import Array
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import WoodClass


class Rods:
    """All known rods, or those of a kind, ready to be asked about many places."""

    def __init__(self, obstacles: tuple[Capsule, ...], kind: WoodClass | None = None) -> None:
        """Pick them out.

        Args:
            obstacles: Rods of all kinds.
            kind: Of those that count; None counts all.
        """
        rods = [rod for rod in obstacles if kind in (None, rod.kind)]
        self._start = np.array([rod.start for rod in rods]).reshape(-1, 3)
        self._axis = np.array([rod.end for rod in rods]).reshape(-1, 3) - self._start
        self._radii = np.array([(rod.start_radius, rod.end_radius) for rod in rods]).reshape(-1, 2)
        self._length = np.maximum(np.einsum("ij,ij->i", self._axis, self._axis), 1e-12)

    def clearance(self, place: Array) -> float | None:
        """Distance (m) from a place (3, m, odom) to the surface of the nearest one; None without any.

        It is negative inside a rod.
        """
        return self.clearances(place[None])[0]

    def clearances(self, places: Array) -> list[float | None]:
        """The same for many places (N×3)."""
        if not len(self._start):
            return [None] * len(places)
        out: list[float | None] = self.gaps(places).min(axis=1).tolist()
        return out

    def gaps(self, places: Array) -> Array:
        """Distance (m) from each of K places (K×3) to the surface of each of N rods, K×N."""
        off = places[:, None] - self._start
        share = np.clip(np.einsum("kij,ij->ki", off, self._axis) / self._length, 0.0, 1.0)
        gaps = np.linalg.norm(off - share[..., None] * self._axis, axis=2)
        first, last = self._radii.T
        out: Array = gaps - first - share * (last - first)
        return out


def clearance(obstacles: tuple[Capsule, ...], kind: WoodClass, place: Array) -> float | None:
    """`Rods.clearance` for a single place."""
    return Rods(obstacles, kind).clearance(place)
