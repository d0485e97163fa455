"""Last year's canes of Guyot vines over all frames, and which spurs are at the head of a vine.

A Guyot vine has its spurs at the head. Other wood that looks like a spur is a shoot of last year's cane.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from perception.arrays import Array, distance, interpolate
from perception.plant.capsules import CapsuleSet
from perception.plant.model import Cane, Plant, Spur
from perception.plant.numbering import SpurNumber
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import Vector3
from rolling_panda.model.wire_values import vector3

#: Spurs so near to a trunk along the row are at its head, and last year's cane begins so near to them (m).
_AT_HEAD, _OF_SPUR = 0.10, 0.15
#: Last year's cane is an obstacle of its own up to this arc length, in pieces of this length (m). Farther out it lies
#: along the row and is one with other cordons.
_BOW, _PIECE = 0.16, 0.08
#: Observations before it is published, and by how much it is then seen elsewhere before it is published again (m).
_MIN_OBSERVATIONS, _TOLERANCE = 3, 0.010
#: The same of its radius (m).
_RADIUS_TOLERANCE = 0.001
#: Points of its line on the page.
_LINE_POINTS = 8
#: Where none is known.
NO_OLD_CANES: Mapping[SpurNumber, Cane] = {}
#: Largest distance of two places where the same one leaves its trunk (m).
_SAME_BASE = 0.05
#: A severed place is on it within this distance (m).
_ON_CANE = 0.02
#: So many are obstacles, those nearest to the camera: the message is as long in a long row.
_MOST = 16


def at_heads(plant: Plant, uprights: Sequence[Capsule], along: Array) -> Plant:
    """A plant with the spurs at the heads of its vines; canes of others are without a spur.

    What shows no cane beside one that does is a piece of it, or a knot of the head.

    Args:
        plant: Of one frame.
        uprights: Trunks and posts that are known; a post may hide a trunk.
        along: Unit vector along the row (3, odom).
    """
    heads = np.array([*plant.trunks, *(np.array(each.end) for each in uprights)]).reshape(-1, 3) @ along

    def at_head(spur: Spur) -> bool:
        return bool(np.abs(heads - float(spur.position @ along)).min(initial=np.inf) < _AT_HEAD)

    def is_piece(spur: Spur) -> bool:
        return not spur.canes and any(distance(spur.position, each.position) < 2 * _AT_HEAD for each in bearing)

    bearing = [spur for spur in plant.spurs if spur.canes and at_head(spur)]
    spurs = tuple(spur for spur in plant.spurs if at_head(spur) and not is_piece(spur))
    others = [cane.axis for spur in plant.spurs if not at_head(spur) for cane in spur.canes]
    return replace(plant, spurs=spurs, unrooted=(*plant.unrooted, *others))


def beside_spurs(
    canes: Sequence[Cane], plant: Plant, numbers: Sequence[SpurNumber], known: Mapping[SpurNumber, Cane] = NO_OLD_CANES
) -> dict[SpurNumber, Cane]:
    """Last year's canes of one frame by the spur beside them; a spur has the nearest one.

    Each is beside the spur that it was beside before, else of those within reach the nearest one of those with canes.

    Args:
        canes: Of the frame.
        plant: Of the same frame.
        numbers: Of its spurs, in their order.
        known: As they were seen last, by spur.
    """
    found: dict[SpurNumber, tuple[float, Cane]] = {}
    for cane in canes:
        before = {number: distance(old.origin, cane.origin) for number, old in known.items()}
        away = [
            (before.get(number, np.inf) > _SAME_BASE, not spur.canes, distance(spur.position, cane.base), number)
            for spur, number in zip(plant.spurs, numbers, strict=True)
        ]
        reach = [each for each in away if each[2] < _OF_SPUR]
        held = min((number for number, gap in before.items() if gap < _SAME_BASE), default=None)
        if not reach or held is not None and held not in numbers:
            continue
        _, _, gap, number = min(reach)
        if gap < found.get(number, (np.inf, cane))[0]:
            found[number] = gap, cane
    return {number: cane for number, (_, cane) in found.items()}


@dataclass
class _Known:
    newest: Cane
    observations: int = 0
    course: Array | None = None
    """Corners of its first stretch as published (K×3, m, odom); None before."""
    radius: float = 0.0
    """As published (m)."""

    def publish(self) -> None:
        """Publish the newest observation if it is another one than the published one."""
        arcs = np.arange(_PIECE, min(_BOW, self.newest.length) + _PIECE / 2, _PIECE)
        # A hidden base goes straight on to the trunk.
        new = np.array([self.newest.origin, *(self.newest.at(float(arc)) for arc in arcs)])
        if self.course is not None:
            # An end that this picture hides is where it was.
            both = min(len(self.course), len(new))
            same = np.linalg.norm(self.course[:both] - new[:both], axis=1).max() <= _TOLERANCE
            if same and len(new) <= len(self.course) and abs(self.newest.radius - self.radius) <= _RADIUS_TOLERANCE:
                return
            new = np.concatenate([new, self.course[len(new) :]])
        self.course, self.radius = new, self.newest.radius


class OldCanes:
    """Remembers them by the spur beside them, and publishes their first stretch as obstacles."""

    def __init__(self) -> None:
        """Start without any."""
        self._known: dict[SpurNumber, _Known] = {}
        self._severed: set[SpurNumber] = set()

    def see(self, canes: Mapping[SpurNumber, Cane]) -> None:
        """Add those of one frame."""
        for number, cane in canes.items():
            known = self._known.setdefault(number, _Known(cane))
            known.newest, known.observations = cane, known.observations + 1
            if known.observations >= _MIN_OBSERVATIONS:
                self._severed.discard(number)
                known.publish()

    @property
    def newest(self) -> dict[SpurNumber, Cane]:
        """Each as it was seen last, by the spur beside it."""
        return {number: known.newest for number, known in self._known.items()}

    def lines(self) -> tuple[tuple[Vector3, ...], ...]:
        """A few points of the axis of each for display (m, odom)."""
        courses = (np.linspace(float(cane.arc[0]), cane.length, _LINE_POINTS) for cane in self.newest.values())
        canes = zip(self.newest.values(), courses, strict=True)
        return tuple(tuple(vector3(p) for p in interpolate(arcs, cane.arc, cane.axis)) for cane, arcs in canes)

    def sever(self, number: SpurNumber, position: Array) -> tuple[Capsule, ...]:
        """Forget the one beside a spur that was severed at a position (3, m, odom).

        Returns:
            What fell, as far as the newest observation shows it; nothing where none is known there.
        """
        known = self._known.get(number)
        if known is None:
            return ()
        # The place of the cut may be hidden in the newest observation.
        whole = _capsules(number, np.array([known.newest.origin, *known.newest.axis]), known.newest.radius)
        away = CapsuleSet(whole).distances(position[None])[0]
        if away.min() >= _ON_CANE:
            return ()
        del self._known[number]
        self._severed.add(number)
        return whole[int(np.argmin(away)) :]

    def is_severed(self, vine: int) -> bool:
        """Whether that of a vine was severed, and none was seen there again."""
        return any(number.vine == vine for number in self._severed)

    def capsules(self, camera: Array) -> tuple[Capsule, ...]:
        """The first stretches of those nearest to the camera (3, m, odom), each with the number of its spur."""
        found = [(number, known, known.course) for number, known in self._known.items() if known.course is not None]
        nearest = sorted(found, key=lambda each: distance(each[2][0], camera))[:_MOST]
        # In constant order, so that messages without news are equal.
        in_order = sorted(nearest, key=lambda each: each[0])
        return tuple(each for number, known, course in in_order for each in _capsules(number, course, known.radius))


def _capsules(number: SpurNumber, course: Array, radius: float) -> tuple[Capsule, ...]:
    """The pieces between the corners of a course (K×3, m, odom)."""
    return tuple(
        Capsule("cordon", vector3(start), vector3(end), radius, radius, number.vine, number.spur)
        for start, end in zip(course, course[1:], strict=False)
    )
