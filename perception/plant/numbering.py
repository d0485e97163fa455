"""Vine and spur numbers that persist from frame to frame."""

from dataclasses import dataclass

import numpy as np

from perception.arrays import Array
from perception.plant.model import Plant

#: A position's mean covers this many observations.
_WINDOW = 20


@dataclass
class _Trunk:
    position: Array
    vine: int


@dataclass
class _Site:
    position: Array
    count: int
    number: "SpurNumber"


@dataclass(frozen=True, order=True)
class SpurNumber:
    """Vine along the row and spur on that vine, both from 1 in the order of their first observation."""

    vine: int
    spur: int


class SpurNumbering:
    """Remembers the positions of spurs and trunks, so that numbers do not change while the robot moves."""

    def __init__(self, spur_separation: float, vine_spacing: float) -> None:
        """Start with an unknown row; distances in metres, as in `TrackerConfig`."""
        self._separation = spur_separation
        self._spacing = vine_spacing
        self._trunks: list[_Trunk] = []
        self._sites: list[_Site] = []

    def number(self, plant: Plant, along: Array) -> tuple[SpurNumber, ...]:
        """Numbers of the plant's spurs, in their order.

        Args:
            plant: Plant of one frame, with spurs in order along the row.
            along: Unit vector along the row (3, odom).
        """
        for position in plant.trunks:
            if all(abs(float((position - t.position) @ along)) >= 0.3 * self._spacing for t in self._trunks):
                self._trunks.append(_Trunk(position, self._vine(position, along)))
        used: set[int] = set()
        return tuple(self._site(spur.position, along, used) for spur in plant.spurs)

    def _vine(self, position: Array, along: Array) -> int:
        """Vine with the nearest trunk along the row; vines out of view are counted by their spacing."""
        if not self._trunks:
            return 1
        nearest = min(self._trunks, key=lambda trunk: abs(float((position - trunk.position) @ along)))
        return max(0, nearest.vine + round(float((position - nearest.position) @ along) / self._spacing))

    def _site(self, position: Array, along: Array, used: set[int]) -> SpurNumber:
        distances = np.linalg.norm(np.array([site.position for site in self._sites]).reshape(-1, 3) - position, axis=1)
        distances[list(used)] = np.inf
        k = int(np.argmin(distances)) if len(distances) else -1
        if k >= 0 and distances[k] < self._separation:
            site = self._sites[k]
            site.count += 1
            site.position = site.position + (position - site.position) / min(site.count, _WINDOW)
        else:
            vine, k = self._vine(position, along), len(self._sites)
            count = sum(site.number.vine == vine for site in self._sites)
            self._sites.append(_Site(position, 1, SpurNumber(vine, count + 1)))
        used.add(k)
        return self._sites[k].number
