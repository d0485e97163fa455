"""Numbers for people: which vine, which spur on it, kept from frame to frame."""

from dataclasses import dataclass

import numpy as np

from perception.plant.model import Array, Plant


@dataclass
class _Trunk:
    place: Array
    number: int


@dataclass
class _Site:
    place: Array
    seen: int
    number: "SpurNumber"


@dataclass(frozen=True)
class SpurNumber:
    """Vine along the row and spur position on it, both from 1 in the order in which they were first seen."""

    vine: int
    spur: int


class RowNumbers:
    """Remembers spur positions and trunks, so that a spur keeps its number while the robot drives on."""

    def __init__(self, spur_separation: float, vine_spacing: float) -> None:
        """Start with an unknown row; distances in metres, as in `TrackerConfig`."""
        self._separation = spur_separation
        self._spacing = vine_spacing
        self._trunks: list[_Trunk] = []
        self._sites: list[_Site] = []

    def number(self, plant: Plant, along: Array) -> tuple[SpurNumber, ...]:
        """The numbers of the plant's spurs, in their order.

        Args:
            plant: As perceived in one frame, spurs in order along the row.
            along: Unit vector along the row (3, odom).
        """
        for place in plant.trunks:
            self._trunk(place, along)
        taken: set[int] = set()
        return tuple(self._site(spur.position, along, taken) for spur in plant.spurs)

    def _trunk(self, place: Array, along: Array) -> None:
        for trunk in self._trunks:
            if abs(float((place - trunk.place) @ along)) < 0.3 * self._spacing:
                return
        self._trunks.append(_Trunk(place, self._vine(place, along)))

    def _vine(self, place: Array, along: Array) -> int:
        """Number of the vine whose trunk is nearest along the row; vines out of view are counted by their spacing."""
        if not self._trunks:
            return 1
        nearest = min(self._trunks, key=lambda trunk: abs(float((place - trunk.place) @ along)))
        return max(0, nearest.number + round(float((place - nearest.place) @ along) / self._spacing))

    def _site(self, place: Array, along: Array, taken: set[int]) -> SpurNumber:
        gaps = np.linalg.norm(np.array([site.place for site in self._sites]).reshape(-1, 3) - place, axis=1)
        gaps[list(taken)] = np.inf
        k = int(np.argmin(gaps)) if len(gaps) else -1
        if k >= 0 and gaps[k] < self._separation:
            site = self._sites[k]
            site.seen += 1
            site.place = site.place + (place - site.place) / min(site.seen, 20)
            taken.add(k)
            return site.number
        vine = self._vine(place, along)
        count = sum(site.number.vine == vine for site in self._sites)
        self._sites.append(_Site(place, 1, SpurNumber(vine, count + 1)))
        taken.add(len(self._sites) - 1)
        return self._sites[-1].number
