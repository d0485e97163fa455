"""The vines as known from all frames: each spur once, its canes once, with what repeated looks say about them.

A cane seen again is known by its spur and by where its axis runs. Its nodes are those that were seen in a good share of
the looks that could have shown them; places and radii are means over the looks, with their scatter.
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.distance import cdist

from perception.plant.model import Array, Cane, Node, Plant, Spur
from perception.plant.numbering import SpurNumber

#: Two axes this near to each other are one cane (m).
_SAME_CANE = 0.015
#: Nodes this near along a cane are one (m).
_SAME_NODE = 0.018
#: Share of the looks at its place that must have shown a node.
_SHARE = 0.4
#: Looks that a mean goes back.
_MEMORY = 20


@dataclass
class Estimate:
    """Mean and scatter of something measured in several looks.

    Attributes:
        mean: Of the looks (N).
        covariance: Of a single look (N×N).
        looks: How many.
    """

    mean: Array
    covariance: Array
    looks: int = 1

    @classmethod
    def of(cls, value: Array) -> "Estimate":
        """From a single look."""
        return cls(np.array(value, dtype=float), np.zeros((len(value), len(value))))

    def add(self, value: Array) -> None:
        """Take one more look in."""
        self.looks += 1
        share = 1.0 / min(self.looks, _MEMORY)
        off = value - self.mean
        self.mean = self.mean + share * off
        self.covariance = (1.0 - share) * (self.covariance + share * np.outer(off, off))


@dataclass
class KnownNode:
    """A node: arc length from the cane's base (m), looks that showed it, and the most pixels it had."""

    arc: Estimate
    pixels: int


@dataclass
class KnownCane:
    """A cane over all looks.

    Attributes:
        best: As seen in the look that showed most of it.
        radius: Over the looks (1, m).
        base: Over the looks (3, m, odom).
        nodes: Seen at least once, by arc length.
        radii: Of the newest looks (m).
        cut_at: Arc length where it was cut (m); infinite while it stands.
    """

    best: Cane
    radius: Estimate
    base: Estimate
    nodes: list[KnownNode] = field(default_factory=list)
    radii: deque[float] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    cut_at: float = np.inf

    def trusted(self) -> tuple[KnownNode, ...]:
        """Nodes seen in a good share of the looks, on what still stands."""
        return tuple(n for n in self.nodes if n.arc.looks >= _SHARE * self.base.looks and n.arc.mean[0] < self.cut_at)

    def steadied(self, cane: Cane) -> Cane:
        """A look at it, as thick as all looks say: in a single one something beside it may have made it wide."""
        return replace(cane, radius=float(np.median(self.radii)), looks=len(self.radii))

    def as_cane(self) -> Cane:
        """The best look with the nodes and the radius of all."""
        nodes = tuple(Node(float(n.arc.mean[0]), n.pixels) for n in self.trusted())
        stands = self.best.arc <= self.cut_at
        if np.count_nonzero(stands) < 2:
            stands[:2] = True
        axis, arc = self.best.axis[stands], self.best.arc[stands]
        end = self.best.end if np.isinf(self.cut_at) else "free"
        return replace(self.best, axis=axis, arc=arc, nodes=nodes, radius=float(self.radius.mean[0]), end=end)


@dataclass
class KnownSpur:
    """A spur over all looks: where it is (3, m, odom), the look that showed most canes, and the canes."""

    number: SpurNumber
    position: Estimate
    best: Spur
    canes: list[KnownCane] = field(default_factory=list)

    def as_spur(self) -> Spur:
        """The best look with canes as known from all."""
        canes = [cane.as_cane() for cane in self.canes if 2 * cane.base.looks >= self.position.looks]
        return replace(self.best, canes=tuple(sorted(canes, key=lambda cane: -cane.length)))


class PlantMap:
    """Gathers plants frame by frame. Its size grows with what was seen, not with how long one looks."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._spurs: dict[SpurNumber, KnownSpur] = {}
        self._trunks: dict[int, Estimate] = {}

    def update(self, plant: Plant, numbers: tuple[SpurNumber, ...]) -> tuple[Spur, ...]:
        """Take the plant of one frame in; returns its spurs with canes as thick as all looks so far say.

        Args:
            plant: As perceived.
            numbers: Of its spurs, in their order.
        """
        steadied = []
        for spur, number in zip(plant.spurs, numbers, strict=True):
            known = self._spurs.get(number)
            if known is None:
                known = self._spurs[number] = KnownSpur(number, Estimate.of(spur.position), spur)
            else:
                known.position.add(spur.position)
                if not spur.doubt and (known.best.doubt or len(spur.canes) > len(known.best.canes)):
                    known.best = spur
            canes = tuple(_add_cane(known, cane).steadied(cane) for cane in spur.canes)
            steadied.append(replace(spur, canes=canes))
        stand = np.array([spur.position.mean[:2] for spur in self._spurs.values()]).reshape(-1, 2)
        vines = np.array([number.vine for number in self._spurs], dtype=int)
        for place in plant.trunks:
            near = vines[np.linalg.norm(stand - place[:2], axis=1) < 0.4].tolist()
            if near:
                vine = max(set(near), key=near.count)
                if vine in self._trunks:
                    self._trunks[vine].add(place)
                else:
                    self._trunks[vine] = Estimate.of(place)
        return tuple(steadied)

    def sever(self, position: Array) -> bool:
        """What lies beyond a cut at `position` (3, m, odom) is gone; whether any known cane passes there."""
        found = self.nearest_cane(position)
        if found is None or found[2] > _SAME_CANE:
            return False
        _, cane, _, arc = found
        cane.cut_at = min(cane.cut_at, arc)
        return True

    def nearest_cane(self, position: Array) -> tuple[KnownSpur, KnownCane, float, float] | None:
        """Spur, cane, distance (m) and arc length (m) of the cane nearest to a place; None where none is known."""
        best: tuple[KnownSpur, KnownCane, float, float] | None = None
        for spur in self._spurs.values():
            for cane in spur.canes:
                gaps = np.linalg.norm(cane.best.axis - position, axis=1)
                k = int(np.argmin(gaps))
                if best is None or gaps[k] < best[2]:
                    best = spur, cane, float(gaps[k]), float(cane.best.arc[k])
        return best

    @property
    def spurs(self) -> tuple[KnownSpur, ...]:
        """All spurs, vine by vine."""
        return tuple(self._spurs[number] for number in sorted(self._spurs, key=lambda n: (n.vine, n.spur)))

    @property
    def trunks(self) -> dict[int, Estimate]:
        """Where each vine's trunk was seen."""
        return dict(self._trunks)


def _add_cane(spur: KnownSpur, cane: Cane) -> KnownCane:
    for known in spur.canes:
        if _gap(known.best, cane) < _SAME_CANE:
            break
    else:
        known = KnownCane(cane, Estimate.of(np.array([cane.radius])), Estimate.of(cane.base), _nodes(cane))
        known.radii.append(cane.radius)
        spur.canes.append(known)
        return known
    known.radius.add(np.array([cane.radius]))
    known.radii.append(cane.radius)
    known.base.add(cane.base)
    if cane.base_gap + _unseen(cane) < known.best.base_gap + _unseen(known.best) and cane.length > 0.2:
        known.best = cane
    for node in cane.nodes:
        near = [other for other in known.nodes if abs(float(other.arc.mean[0]) - node.arc) < _SAME_NODE]
        if near:
            same = min(near, key=lambda other: abs(float(other.arc.mean[0]) - node.arc))
            same.arc.add(np.array([node.arc]))
            same.pixels = max(same.pixels, node.pixels)
        else:
            known.nodes.append(KnownNode(Estimate.of(np.array([node.arc])), node.pixels))
    known.nodes.sort(key=lambda node: float(node.arc.mean[0]))
    return known


def _nodes(cane: Cane) -> list[KnownNode]:
    return [KnownNode(Estimate.of(np.array([node.arc])), node.pixels) for node in cane.nodes]


def _gap(first: Cane, second: Cane) -> float:
    """Median distance of the two axes over the first decimetres that both have."""
    near = second.axis[second.arc < 0.25]
    if len(near) < 2:
        near = second.axis
    return float(np.median(cdist(near, first.axis).min(axis=1)))


def _unseen(cane: Cane) -> float:
    return sum(span.end - span.start for span in cane.hidden)
