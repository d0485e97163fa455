"""Right cuts that the blades cannot come to, by the simulator's truth: something else is between them everywhere."""

from typing import Literal

import numpy as np

from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.truth import RightCut

#: Half the opening of the blades: a cane whose axis is nearer than this to the cut is between them too (m).
CANE_ROOM = 0.015
#: Keep-out of wires, hoses and posts, from their surface (m).
WIRE_ROOM = 0.015
#: Places tried from one end of the right stretch to the other.
_PLACES = 9

Blocker = Literal["", "cane", "wire", "post"]


def blocked_by(row: Row, cut: RightCut) -> Blocker:
    """What leaves no room for the blades wherever the cut is made within its right stretch; empty where there is room.

    Where several things are in the way, it is the one in the way of the best place.

    Args:
        row: Before any cut.
        cut: The right one.
    """
    own = row.rods[cut.rod]
    assert own is not None
    cane = own.vine, own.spur, own.cane
    canes = [
        rod
        for _, rod in row.standing()
        if rod.kind in ("cane", "node")
        # Laterals may be cut along.
        and rod.organ < 0
        and (rod.vine, rod.spur, rod.cane) != cane
        and _near(rod, cut)
    ]
    hard = [rod for _, rod in row.standing() if rod.kind in ("wire", "hose", "post") and _near(rod, cut)]
    places = cut.least + np.linspace(0.0, 1.0, _PLACES)[:, None] * (cut.most - cut.least)
    if not all(_blocker(place, canes, hard) for place in places):
        return ""
    return _blocker(cut.best, canes, hard) or _blocker(places[0], canes, hard)


def _blocker(place: Array, canes: list[Rod], hard: list[Rod]) -> Blocker:
    for rod in hard:
        if _gap(rod, place)[0] - _gap(rod, place)[1] < WIRE_ROOM:
            return "post" if rod.kind == "post" else "wire"
    return "cane" if any(_gap(rod, place)[0] < CANE_ROOM for rod in canes) else ""


def _near(rod: Rod, cut: RightCut) -> bool:
    """Whether a rod could be in the way of any place of the stretch."""
    away, radius = _gap(rod, cut.best)
    return away - radius < max(CANE_ROOM, WIRE_ROOM) + float(np.linalg.norm(cut.most - cut.least))


def _gap(rod: Rod, place: Array) -> tuple[float, float]:
    """Distance (m) of a rod's axis from a place, and its radius there (m)."""
    axis = rod.end - rod.start
    share = float(np.clip((place - rod.start) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0))
    point, radius = rod.at(share)
    return float(np.linalg.norm(place - point)), radius
