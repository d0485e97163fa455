"""How far a cut is from what the blades must not touch."""

import numpy as np

from perception.plant import Array
from rolling_panda.messages import WoodClass
from rolling_panda.row_messages import Capsule


class Rods:
    """All known rods of a kind, ready to be asked about many places."""

    def __init__(self, obstacles: tuple[Capsule, ...], kind: WoodClass) -> None:
        """Pick them out.

        Args:
            obstacles: Rods of all kinds.
            kind: Of those that count.
        """
        rods = [rod for rod in obstacles if rod.kind == kind]
        self._start = np.array([rod.start for rod in rods]).reshape(-1, 3)
        self._axis = np.array([rod.end for rod in rods]).reshape(-1, 3) - self._start
        self._radii = np.array([(rod.start_radius, rod.end_radius) for rod in rods]).reshape(-1, 2)
        self._length = np.maximum(np.einsum("ij,ij->i", self._axis, self._axis), 1e-12)

    def clearance(self, place: Array) -> float | None:
        """Distance (m) from a place (3, m, odom) to the surface of the nearest one; None without any.

        It is negative inside a rod.
        """
        if not len(self._start):
            return None
        off = place - self._start
        share = np.clip(np.einsum("ij,ij->i", off, self._axis) / self._length, 0.0, 1.0)
        gaps = np.linalg.norm(off - share[:, None] * self._axis, axis=1)
        first, last = self._radii.T
        return float(np.min(gaps - first - share * (last - first)))


def clearance(obstacles: tuple[Capsule, ...], kind: WoodClass, place: Array) -> float | None:
    """`Rods.clearance` for a single place."""
    return Rods(obstacles, kind).clearance(place)
