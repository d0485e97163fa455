"""Map of the vines over all frames: each spur and each cane once, with statistics over their observations.

A cane is identified by its spur and the course of its axis. Its nodes are those seen in a sufficient fraction of the
observations; positions and radii are means with their scatter.
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from perception.arrays import Array, distance, interpolate
from perception.plant.model import Cane, Node, Plant, Span, Spur
from perception.plant.numbering import SpurNumber
from rolling_panda.messages.types import Vector3
from rolling_panda.model.wire_values import vector3

#: A cane may be seen so far from where it was seen before: in the wind, and as the camera's place errs (m).
_SAME_CANE = 0.025
#: A cut is on the cane whose axis is nearer to it than this (m).
_AT_CUT = 0.015
#: Part of a cane by which two observations are aligned (m from the base), and how many of its points that takes.
_NEAR_BASE, _ALIGNED = 0.25, 5
#: Nodes nearer than this along a cane are one (m).
_SAME_NODE = 0.018
#: A node counts if at least this share of the frames that show its place show it. A false node makes the cut one node
#: too low, which cannot be undone; a missed one makes it one too high.
_MIN_SHARE = 0.6
#: Observations that a mean covers.
_WINDOW = 20
#: Stretches of a cane that are told apart by whether a frame has shown them (m), and how many there are.
_STRETCH, _STRETCHES = 0.003, 500
#: No observation of a cane up to this length is the most complete one (m).
_SHORT = 0.2
#: Number of points of a cane's line for display, and its smallest length (m).
_LINE_POINTS, _MIN_LINE = 9, 0.02


@dataclass
class Estimate:
    """Running mean and scatter of a measured vector.

    Attributes:
        mean: Mean of the observations (N).
        covariance: Covariance of a single observation (N×N).
        count: Number of observations.
    """

    mean: Array
    covariance: Array
    count: int = 1

    @classmethod
    def of(cls, value: Array) -> "Estimate":
        """From a single observation."""
        return cls(np.array(value, dtype=float), np.zeros((len(value), len(value))))

    def add(self, value: Array) -> None:
        """Add an observation."""
        self.count += 1
        gain = 1.0 / min(self.count, _WINDOW)
        off = value - self.mean
        self.mean = self.mean + gain * off
        self.covariance = (1.0 - gain) * (self.covariance + gain * np.outer(off, off))


@dataclass
class KnownNode:
    """A node: arc length from the cane's base (m), and its largest size (px)."""

    estimate: Estimate
    pixels: int

    @property
    def arc(self) -> float:
        """Mean arc length (m)."""
        return float(self.estimate.mean[0])


@dataclass
class KnownCane:
    """A cane over all observations.

    Frames see the base at different places, where the border of spur and cane is unclear. So observations are aligned
    by their places in space, and all arc lengths are measured from the median of the bases, to half a stretch.

    Attributes:
        number: Number on its spur.
        best: The most complete observation.
        radius: Estimate (1, m).
        base: Estimate (3, m, odom).
        nodes: Seen at least once, by arc length.
        radii: Newest measurements (m).
        bases: Newest measurements of the base, by arc length (m).
        shown: How many frames have shown each stretch, from the base.
        cut_at: Arc length of a cut that was made (m); infinite while the cane stands.
    """

    number: int
    best: Cane
    radius: Estimate
    base: Estimate
    nodes: list[KnownNode] = field(default_factory=list)
    radii: deque[float] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    bases: deque[float] = field(default_factory=lambda: deque([0.0], maxlen=_WINDOW))
    shown: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_STRETCHES, dtype=np.int64))
    cut_at: float = np.inf

    @classmethod
    def of(cls, cane: Cane, number: int) -> "KnownCane":
        """From a single observation."""
        known = cls(number, cane, Estimate.of(np.array([cane.radius])), Estimate.of(cane.base))
        known.nodes = [KnownNode(Estimate.of(np.array([node.arc])), node.pixels) for node in cane.nodes]
        known.radii.append(cane.radius)
        known.shown += _shown(cane)
        return known

    def add(self, cane: Cane, reach: float) -> Cane:
        """Add an observation; returns it with arc lengths from the base of all.

        Args:
            cane: As one frame shows it.
            reach: What is seen beyond this arc length makes it no more complete (m).
        """
        offset = self._offset(cane)
        self.bases.append(offset)
        cane = cane.shifted(offset - self._move_base(round(float(np.median(self.bases)) / _STRETCH)))
        self.radius.add(np.array([cane.radius]))
        self.radii.append(cane.radius)
        self.shown += _shown(cane)
        self.base.add(cane.base)
        if cane.length > _SHORT and _unseen(cane, reach) < _unseen(self.best, reach):
            self.best = cane
        for node in cane.nodes:
            near = [known for known in self.nodes if abs(known.arc - node.arc) < _SAME_NODE]
            if near:
                same = min(near, key=lambda known: abs(known.arc - node.arc))
                same.estimate.add(np.array([node.arc]))
                same.pixels = max(same.pixels, node.pixels)
            else:
                self.nodes.append(KnownNode(Estimate.of(np.array([node.arc])), node.pixels))
        self.nodes.sort(key=lambda node: node.arc)
        return cane

    def _offset(self, cane: Cane) -> float:
        """By how much an observation's arc lengths are less than those of the map (m); 0 where that is not seen."""
        near, axis = cane.arc < _NEAR_BASE, self.best.axis
        away = cdist(cane.axis[near], axis)
        nearest = away.argmin(axis=1)
        # Points that are nearest to an end may lie beyond it.
        inside = (nearest > 0) & (nearest < len(axis) - 1) & (away.min(axis=1) < _SAME_CANE)
        if np.count_nonzero(inside) < _ALIGNED:
            return 0.0
        own, nearest = np.flatnonzero(near)[inside], nearest[inside]
        chord = axis[nearest + 1] - axis[nearest - 1]
        tangent = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9)
        further = np.einsum("ij,ij->i", cane.axis[own] - axis[nearest], tangent)
        return float(np.median(self.best.arc[nearest] + further - cane.arc[own]))

    def _move_base(self, stretches: int) -> float:
        """Measure from another base, so many stretches farther out; returns how far that is (m)."""
        by = stretches * _STRETCH
        if stretches:
            self.best, self.cut_at = self.best.shifted(-by), self.cut_at - by
            for node in self.nodes:
                node.estimate.mean = node.estimate.mean - by
            self.bases = deque((base - by for base in self.bases), maxlen=_WINDOW)
            self.shown = np.roll(self.shown, -stretches)
        return by

    def with_other_views(self, cane: Cane) -> Cane:
        """An observation of it, aligned, with its number, and what other frames have shown of it.

        That is the median radius, as single ones may include wood beside it, and its nodes as far out as this one goes.
        Stretches that this one does not show, but another one does, are hidden no longer.
        """
        return replace(
            cane,
            radius=float(np.median(self.radii)),
            nodes=self._nodes(cane.length),
            hidden=tuple(span for part in cane.hidden for span in self._unseen_of(part)),
            observations=len(self.radii),
            number=self.number,
        )

    def _nodes(self, length: float) -> tuple[Node, ...]:
        """The nodes up to an arc length (m) that enough of the frames that show their place have shown."""
        return tuple(
            Node(node.arc, node.pixels)
            for node in self.nodes
            if node.arc < length and node.estimate.count >= _MIN_SHARE * float(self.shown[_stretch(node.arc)])
        )

    def _unseen_of(self, part: Span) -> list[Span]:
        """The stretches of a hidden one that no frame has shown."""
        first, last = _stretch(part.start), _stretch(part.end)
        unseen = np.flatnonzero(self.shown[first : last + 1] == 0)
        if not len(unseen):
            return []
        runs = np.split(unseen, np.flatnonzero(np.diff(unseen) > 1) + 1)
        return [
            Span(max(part.start, _STRETCH * (first + run[0])), min(part.end, _STRETCH * (first + run[-1] + 1)))
            for run in runs
        ]

    def as_cane(self) -> Cane:
        """The best observation with the radius and the confirmed nodes of all, up to a cut.

        Nodes beyond what it shows of the cane have no place.
        """
        nodes = self._nodes(min(self.cut_at, self.best.length))
        stands = self.best.arc <= self.cut_at
        if np.count_nonzero(stands) < 2:
            stands[:2] = True
        axis, arc = self.best.axis[stands], self.best.arc[stands]
        end = self.best.end if np.isinf(self.cut_at) else "free"
        radius = float(self.radius.mean[0])
        hidden = tuple(span for part in self.best.hidden for span in self._unseen_of(part))
        return replace(
            self.best, axis=axis, arc=arc, nodes=nodes, radius=radius, hidden=hidden, end=end, number=self.number
        )

    def line(self) -> tuple[Vector3, ...]:
        """A few points of the standing axis for display (m, odom); empty where it is too short."""
        start, end = float(self.best.arc[0]), min(self.best.length, self.cut_at)
        if end - start < _MIN_LINE:
            return ()
        return tuple(
            vector3(p) for p in interpolate(np.linspace(start, end, _LINE_POINTS), self.best.arc, self.best.axis)
        )


@dataclass
class KnownSpur:
    """A spur over all observations: its position (3, m, odom), its most complete observation, its canes and its stub.

    Attributes:
        stubs: Newest measurements of the stub, from the cordon outwards: both ends (m, odom) and radius (m), 7 each.
    """

    number: SpurNumber
    position: Estimate
    best: Spur
    canes: list[KnownCane] = field(default_factory=list)
    stubs: deque[Array] = field(default_factory=lambda: deque(maxlen=_WINDOW))

    def with_median_stub(self, spur: Spur) -> Spur:
        """An observation of it, which is added, with the median stub of all: single ones may include wood beside it."""
        if spur.axis is not None and spur.radius > 0.0:
            self.stubs.append(np.array([*spur.axis.ravel(), spur.radius]))
        if not self.stubs:
            return spur
        return replace(spur, axis=self.stub, radius=float(np.median([stub[6] for stub in self.stubs])))

    @property
    def stub(self) -> Array | None:
        """Both ends of the median stub from the cordon outwards (2×3, m, odom); None where none was measured."""
        if not self.stubs:
            return None
        median: Array = np.median(self.stubs, axis=0)
        return median[:6].reshape(2, 3)

    def as_spur(self) -> Spur:
        """The best observation with the mapped canes that at least half of the observations have shown."""
        canes = [cane.as_cane() for cane in self.canes if 2 * cane.base.count >= self.position.count]
        return replace(self.best, canes=tuple(sorted(canes, key=lambda cane: -cane.length)))

    def hidden_canes(self, seen: tuple[Cane, ...]) -> tuple[Cane, ...]:
        """The standing canes that at least a third of the observations have shown, but this one does not."""
        numbers = {cane.number for cane in seen}
        return tuple(
            cane.with_other_views(cane.best)
            for cane in self.canes
            if cane.number not in numbers and 3 * cane.base.count >= self.position.count and np.isinf(cane.cut_at)
        )

    def nearest_cane(self, position: Array) -> tuple[int, float, float]:
        """Index, distance (m) and arc length (m) of the cane nearest to a position; distance infinite without canes."""
        best = 0, np.inf, 0.0
        for index, cane in enumerate(self.canes):
            distances = np.linalg.norm(cane.best.axis - position, axis=1)
            k = int(np.argmin(distances))
            if distances[k] < best[1]:
                best = index, float(distances[k]), float(cane.best.arc[k])
        return best


@dataclass(frozen=True)
class Surroundings:
    """Standing wood around a position: axes of canes, each N×3, and nodes, N×3 (m, odom)."""

    axes: tuple[Array, ...] = ()
    nodes: Array = field(default_factory=lambda: np.zeros((0, 3)))


#: Of a row that nobody has seen.
NOTHING_KNOWN = Surroundings()


class PlantMap:
    """Collects the plants of all frames. Its size depends on the row, not on the number of frames."""

    def __init__(self) -> None:
        """Start with an unknown row."""
        self._spurs: dict[SpurNumber, KnownSpur] = {}

    def update(self, plant: Plant, numbers: tuple[SpurNumber, ...], reach: float = _SHORT) -> tuple[Spur, ...]:
        """Add the plant of one frame; returns its spurs with the median stub, and their canes as all frames show them.

        They have the hidden canes that at least a third of the observations have shown.

        Args:
            plant: Plant of one frame.
            numbers: Of its spurs, in their order.
            reach: Arc length up to which a cane is to be seen (m).
        """
        out = []
        for spur, number in zip(plant.spurs, numbers, strict=True):
            known = self._spurs.get(number)
            if known is None:
                known = self._spurs[number] = KnownSpur(number, Estimate.of(spur.position), spur)
            else:
                known.position.add(spur.position)
                if not spur.incomplete and (known.best.incomplete or len(spur.canes) > len(known.best.canes)):
                    known.best = spur
            seen = _associate(known, spur.canes, reach)
            out.append(replace(known.with_median_stub(spur), canes=seen, hidden=known.hidden_canes(seen)))
        return tuple(out)

    def sever(self, position: Array) -> bool:
        """Remove the wood beyond a cut at `position` (3, m, odom); whether a known cane was there."""
        found = self.nearest_cane(position)
        if found is None or found[2] > _AT_CUT:
            return False
        _, cane, _, arc = found
        cane.cut_at = min(cane.cut_at, arc)
        return True

    def nearest_cane(self, position: Array) -> tuple[KnownSpur, KnownCane, float, float] | None:
        """Spur, cane, distance (m) and arc length (m) of the cane nearest to a position; None without canes."""
        found = [(spur, *spur.nearest_cane(position)) for spur in self._spurs.values() if spur.canes]
        if not found:
            return None
        spur, index, distance, arc = min(found, key=lambda each: each[2])
        return spur, spur.canes[index], distance, arc

    def around(self, position: Array, radius: float) -> Surroundings:
        """What is known within a radius (m) of a position (3, m, odom)."""
        axes, nodes = [], [np.zeros((0, 3))]
        for spur in self._spurs.values():
            for cane in (known.as_cane() for known in spur.canes):
                near = cane.axis[np.linalg.norm(cane.axis - position, axis=1) < radius]
                if len(near) >= 2:
                    axes.append(near)
                    nodes += [cane.at(node.arc)[None] for node in cane.nodes]
        found = np.concatenate(nodes)
        return Surroundings(tuple(axes), found[np.linalg.norm(found - position, axis=1) < radius])

    @property
    def spurs(self) -> tuple[KnownSpur, ...]:
        """All spurs, vine by vine."""
        return tuple(spur for _, spur in sorted(self._spurs.items()))

    def canes_above(self, arc: float, observations: int, position: Array, radius: float) -> Array:
        """Points on the standing axes of canes, N×3 (m, odom).

        Args:
            arc: From here on (m from the base).
            observations: Least number of frames that have shown the cane; a third of those of its spur at least.
            position: Of spurs within `radius` (m) of this place (3, m, odom).
            radius: See there.
        """
        near = [spur for spur in self._spurs.values() if distance(spur.position.mean, position) < radius]
        axes = [
            cane.best.axis[(cane.best.arc > arc) & (cane.best.arc < cane.cut_at)]
            for spur in near
            for cane in spur.canes
            if cane.base.count >= observations and 3 * cane.base.count >= spur.position.count
        ]
        return np.concatenate([np.zeros((0, 3)), *axes])

    def cane_lines(self) -> tuple[tuple[Vector3, ...], ...]:
        """The standing axis of each cane as a line for display (m, odom)."""
        return tuple(line for spur in self.spurs for cane in spur.canes if (line := cane.line()))


def _associate(spur: KnownSpur, canes: tuple[Cane, ...], reach: float) -> tuple[Cane, ...]:
    """Add the canes of one frame to those that they are; returns them with what other frames have shown.

    A frame shows a cane once. So each goes to another one of the map, all of them together as near as they can be.
    """
    away = np.array([[_axis_distance(known.best, cane) for known in spur.canes] for cane in canes])
    away = np.minimum(away.reshape(len(canes), len(spur.canes)), _SAME_CANE)
    same = {int(i): spur.canes[k] for i, k in zip(*linear_sum_assignment(away), strict=True) if away[i, k] < _SAME_CANE}
    out = []
    for i, cane in enumerate(canes):
        known = same.get(i)
        if known is None:
            spur.canes.append(KnownCane.of(cane, len(spur.canes)))
            out.append(spur.canes[-1].with_other_views(cane))
        else:
            out.append(known.with_other_views(known.add(cane, reach)))
    return tuple(out)


def _axis_distance(first: Cane, second: Cane) -> float:
    """Median distance of two axes near their base (m)."""
    near = second.axis[second.arc < _NEAR_BASE]
    if len(near) < 2:
        near = second.axis
    return float(np.median(cdist(near, first.axis).min(axis=1)))


def _stretch(arc: float) -> int:
    return min(max(int(arc / _STRETCH), 0), _STRETCHES - 1)


def _shown(cane: Cane) -> NDArray[np.int64]:
    """Of each stretch whether this observation shows the whole of it."""
    shown = np.zeros(_STRETCHES, dtype=np.int64)
    shown[_stretch(float(cane.arc[0])) : _stretch(cane.length)] = 1
    for span in cane.hidden:
        shown[_stretch(span.start) : _stretch(span.end) + 1] = 0
    return shown


def _unseen(cane: Cane, reach: float) -> float:
    """Length that was not seen, up to where it ends or is to be seen (m)."""
    hidden = sum(span.end - span.start for span in cane.hidden)
    return cane.base_gap + hidden + max(0.0, reach - cane.length)
