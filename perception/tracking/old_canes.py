"""Last year's canes of Guyot vines, over all frames, and what stands at the head of a vine.

The spurs of a Guyot vine are at its head. What else looks like one is a shoot of last year's cane, and goes with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from perception.arrays import Array, distance, interpolate
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
#: Points of its line on the page.
_LINE_POINTS = 8
#: A severed place is on it within this distance (m).
_ON_CANE = 0.02


def at_heads(plant: Plant, uprights: Sequence[Capsule], along: Array) -> Plant:
    """A plant with the spurs at the heads of its vines; canes of others are without a spur.

    Args:
        plant: Of one frame.
        uprights: Trunks and posts that are known; a post may hide a trunk.
        along: Unit vector along the row (3, odom).
    """
    heads = np.array([*plant.trunks, *(np.array(each.end) for each in uprights)]).reshape(-1, 3) @ along

    def at_head(spur: Spur) -> bool:
        return bool(np.abs(heads - float(spur.position @ along)).min(initial=np.inf) < _AT_HEAD)

    others = [cane.axis for spur in plant.spurs if not at_head(spur) for cane in spur.canes]
    return replace(plant, spurs=tuple(filter(at_head, plant.spurs)), unrooted=(*plant.unrooted, *others))


def beside_spurs(canes: Sequence[Cane], plant: Plant, numbers: Sequence[SpurNumber]) -> dict[SpurNumber, Cane]:
    """Last year's canes of one frame by the spur beside them, each beside the nearest; a spur has the nearest one."""
    found: dict[SpurNumber, tuple[float, Cane]] = {}
    for cane in canes:
        away = [(distance(spur.position, cane.base), number) for spur, number in zip(plant.spurs, numbers, strict=True)]
        gap, number = min(away, default=(np.inf, SpurNumber(0, 0)))
        if gap < _OF_SPUR and gap < found.get(number, (np.inf, cane))[0]:
            found[number] = gap, cane
    return {number: cane for number, (_, cane) in found.items()}


@dataclass
class _Known:
    newest: Cane
    observations: int = 1
    published: Array | None = None

    @property
    def course(self) -> Array:
        """Corners of its first stretch (K×3, m, odom)."""
        arcs = np.arange(0.0, min(_BOW, self.newest.length) + _PIECE / 2, _PIECE)
        return np.array([self.newest.at(float(arc)) for arc in arcs])


class OldCanes:
    """Remembers them by the spur beside them, and publishes their first stretch as obstacles."""

    def __init__(self) -> None:
        """Start without any."""
        self._known: dict[SpurNumber, _Known] = {}

    def see(self, canes: Mapping[SpurNumber, Cane]) -> None:
        """Add those of one frame."""
        for number, cane in canes.items():
            known = self._known.setdefault(number, _Known(cane, 0))
            known.newest, known.observations = cane, known.observations + 1
            if known.observations < _MIN_OBSERVATIONS:
                continue
            old, new = known.published, known.course
            if old is None or len(old) != len(new) or np.linalg.norm(old - new, axis=1).max() > _TOLERANCE:
                known.published = new

    @property
    def newest(self) -> dict[SpurNumber, Cane]:
        """Each as it was seen last, by the spur beside it."""
        return {number: known.newest for number, known in self._known.items()}

    def lines(self) -> tuple[tuple[Vector3, ...], ...]:
        """A few points of the axis of each for display (m, odom)."""
        courses = (np.linspace(float(cane.arc[0]), cane.length, _LINE_POINTS) for cane in self.newest.values())
        canes = zip(self.newest.values(), courses, strict=True)
        return tuple(tuple(vector3(p) for p in interpolate(arcs, cane.arc, cane.axis)) for cane, arcs in canes)

    def sever(self, position: Array) -> bool:
        """Forget the one that was severed at a position (3, m, odom); whether one was there."""
        for number, known in self._known.items():
            if np.linalg.norm(known.newest.axis - position, axis=1).min() < _ON_CANE:
                del self._known[number]
                return True
        return False

    def capsules(self) -> tuple[Capsule, ...]:
        """Their first stretches in odom (m), each with the number of the spur beside it."""
        out = []
        for number, known in sorted(self._known.items()):
            course, radius = known.published, known.newest.radius
            if course is None:
                continue
            for start, end in zip(course, course[1:], strict=False):
                out.append(Capsule("cordon", vector3(start), vector3(end), radius, radius, number.vine, number.spur))
        return tuple(out)
