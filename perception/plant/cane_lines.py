"""The canes that are known, as lines for people: what a click can put a point on."""

import numpy as np

from perception.plant.map import KnownCane, PlantMap
from rolling_panda.messages.types import Vector3

#: Places of a line at most. Canes are nearly straight, and a row has hundreds.
_PLACES = 9
#: A shorter remainder is not drawn (m).
_SHORTEST = 0.02


def cane_lines(known: PlantMap) -> tuple[tuple[Vector3, ...], ...]:
    """The axis of each known cane as far as it stands, in odom (m)."""
    lines = (_line(cane) for spur in known.spurs for cane in spur.canes)
    return tuple(line for line in lines if line)


def _line(cane: KnownCane) -> tuple[Vector3, ...]:
    arc, axis = cane.best.arc, cane.best.axis
    end = min(float(arc[-1]), cane.cut_at)
    if end - float(arc[0]) < _SHORTEST:
        return ()
    places = np.linspace(float(arc[0]), end, _PLACES)
    x, y, z = (np.interp(places, arc, axis[:, i]).tolist() for i in range(3))
    return tuple(zip(x, y, z, strict=True))
