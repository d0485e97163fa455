"""Vine and spur numbers that persist from frame to frame."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from perception.arrays import Array
from perception.plant.model import Plant, Spur

#: Distances across the row count less than those along it, as neighbouring spurs differ along it. Wood without canes
#: is a piece of a spur within this multiple of the distance between spurs.
_ACROSS, _BARE = 0.6, 1.3
#: Largest distance of wood on a cane from the axis of that cane, and of a cane that is the same one (m).
_ON_CANE, _ALONG_CANE = 0.015, 0.025
_NO_POINTS: Array = np.zeros((0, 3))
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

    def numbered(self, plant: Plant, along: Array, canes: Array = _NO_POINTS) -> tuple[Plant, tuple[SpurNumber, ...]]:
        """The plant with each spur once, and the numbers of its spurs in their order.

        Hidden wood or lost depth divides a spur in some frames, and a piece of a cane is taken for one in others. What
        is nearer to a spur than another spur would be is a piece of it: its canes are canes of that spur. What is new
        and on a known cane, with canes along it alone, is no spur; its canes are without one.

        Args:
            plant: Plant of one frame, with spurs in order along the row.
            along: Unit vector along the row (3, odom).
            canes: Points on the axes of known canes near the camera, away from their spurs (N×3, odom).
        """
        for position in plant.trunks:
            if all(abs(float((position - t.position) @ along)) >= 0.3 * self._spacing for t in self._trunks):
                self._trunks.append(_Trunk(position, self._vine(position, along)))
        sites, owners = self._matched(plant.spurs, along, canes)
        spurs, numbers = [], []
        for i, spur in enumerate(plant.spurs):
            if owners[i] == i:
                spurs.append(_whole(spur, [plant.spurs[k] for k, owner in owners.items() if owner == i and k != i]))
                numbers.append(self._observe(spur.position, sites.get(i), along))
        unrooted = [cane.axis for i, spur in enumerate(plant.spurs) if owners[i] is None for cane in spur.canes]
        return replace(plant, spurs=tuple(spurs), unrooted=(*plant.unrooted, *unrooted)), tuple(numbers)

    def _vine(self, position: Array, along: Array) -> int:
        """Vine with the nearest trunk along the row; vines out of view are counted by their spacing."""
        if not self._trunks:
            return 1
        nearest = min(self._trunks, key=lambda trunk: abs(float((position - trunk.position) @ along)))
        return max(0, nearest.vine + round(float((position - nearest.position) @ along) / self._spacing))

    def _matched(
        self, spurs: tuple[Spur, ...], along: Array, canes: Array
    ) -> tuple[dict[int, int], dict[int, int | None]]:
        """Which site each known spur of a frame is, and which spur each is a piece of.

        Spurs are the sites that they are nearest to, all of them together, those with canes before others. Of the rest
        what continues a known cane is nothing. Those near one of the spurs are pieces, and bare wood near a site is
        nothing either.

        Returns:
            Index of the site by that of the spur; index of the whole spur by that of each, its own for a whole one and
            None for nothing.
        """
        places = _upright([spur.position for spur in spurs], along)
        known = cdist(places, _upright([site.position for site in self._sites], along))
        bare = np.array([not spur.canes for spur in spurs], dtype=bool)
        # Any place with canes is worth more than the nearest one without.
        gain = np.where(known < self._separation, 2.0 * self._separation - known, 0.0)
        gain[bare] = np.maximum(gain[bare] - self._separation, 0.0)
        pairs = zip(*linear_sum_assignment(gain, maximize=True), strict=True)
        sites = {int(i): int(k) for i, k in pairs if known[i, k] < self._separation}
        owners: dict[int, int | None] = {i: i for i in sites}
        apart = cdist(places, places)
        for i in sorted(set(range(len(spurs))) - set(sites), key=lambda i: -len(spurs[i].canes)):
            nearest = min((k for k, owner in owners.items() if owner == k), key=lambda k: float(apart[i, k]), default=i)
            reach = self._separation * (_BARE if bare[i] else 1.0)
            if _continues(spurs[i], canes):
                owners[i] = None
            elif nearest != i and apart[i, nearest] < reach:
                owners[i] = nearest
            else:
                owners[i] = None if bare[i] and known[i].min(initial=np.inf) < reach else i
        return sites, owners

    def _observe(self, position: Array, k: int | None, along: Array) -> SpurNumber:
        """Add an observation to the site with this index, or a new site without one; returns its number."""
        if k is None:
            vine = self._vine(position, along)
            count = sum(site.number.vine == vine for site in self._sites)
            self._sites.append(_Site(position, 1, SpurNumber(vine, count + 1)))
            return self._sites[-1].number
        site = self._sites[k]
        site.count += 1
        site.position = site.position + (position - site.position) / min(site.count, _WINDOW)
        return site.number


def _upright(positions: list[Array], along: Array) -> Array:
    """Positions (N×3) with distances across the row shortened: spurs stand beside each other along it."""
    out = np.array(positions).reshape(-1, 3)
    return out - (1.0 - _ACROSS) * (out - (out @ along)[:, None] * along)


def _continues(spur: Spur, canes: Array) -> bool:
    """Whether a spur is on known canes (points N×3), and its own canes run along them."""
    if cdist(spur.position[None], canes).min(initial=np.inf) > _ON_CANE:
        return False
    return all(float(np.median(cdist(cane.axis, canes).min(axis=1))) < _ALONG_CANE for cane in spur.canes)


def _whole(spur: Spur, pieces: list[Spur]) -> Spur:
    """A spur with the canes of its pieces."""
    if not pieces:
        return spur
    canes = sorted((cane for each in (spur, *pieces) for cane in each.canes), key=lambda cane: -cane.length)
    incomplete = next((each.incomplete for each in (spur, *pieces) if each.incomplete is not None), None)
    return replace(spur, canes=tuple(canes), incomplete=incomplete)
