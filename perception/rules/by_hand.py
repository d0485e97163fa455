"""A point where a person wants it: snapped to the nearest known cane, with everything that a found one has."""

import numpy as np

from perception.config import RuleConfig
from perception.plant.map import KnownCane, KnownSpur, PlantMap
from perception.plant.model import Array
from perception.plant.numbering import SpurNumber
from perception.rules.keep_out import near_wire
from perception.rules.spur import Cut, count_nodes, nearest_node
from rolling_panda.messages.perception import Capsule

#: A click this far beside a cane means it (m); from afar also one that is so far beside it in the picture (rad).
_BESIDE, _BESIDE_ANGLE = 0.025, 0.012
#: A cut slides this far along the cane from a click to where the blades may be (m), in such steps.
_SLIDE, _SLIDE_STEP = 0.016, 0.001
#: Where no cane is known this near to the line of sight (m), that part of the row has not been seen.
_SEEN = 0.3
#: A point this far from a cane's axis is on it (m).
_ON_CANE = 0.012
#: Buds keep this distance from the blades (m).
_FROM_NODE = 0.010


def point_by_hand(
    known: PlantMap,
    origin: Array,
    direction: Array,
    config: RuleConfig,
    obstacles: tuple[Capsule, ...],
    user: str,
) -> tuple[Cut, SpurNumber] | str:
    """The cut on the cane that a line of sight passes nearest, or why there is none.

    Args:
        known: The vines.
        origin: Where the line begins (3, m, odom).
        direction: Unit vector along it (3, odom).
        config: The rule's numbers.
        obstacles: Wires among them are kept away from.
        user: Who placed it.
    """
    found = _nearest(known, origin, direction)
    if found is None or found[0] > _SEEN:
        return "this part of the row has not been seen yet: drive there, with Survey for instance, and click again"
    gap, spur, number, arc, away = found
    if gap > max(_BESIDE, _BESIDE_ANGLE * away):
        return f"the nearest cane that was seen passes {1000 * gap:.0f} mm beside there: click on a blue line"
    whose, why = f"Placed by {user}", ""
    for slide in sorted(np.arange(-_SLIDE, _SLIDE + _SLIDE_STEP / 2, _SLIDE_STEP).tolist(), key=abs):
        cut = _cut_at(spur, number, arc + slide, config, obstacles, whose)
        if isinstance(cut, Cut):
            return cut, spur.number
        why = why or cut
    return f"{why}; click {1000 * _SLIDE:.0f} mm or more away along the cane"


def moved_by_hand(
    known: PlantMap,
    position: Array,
    along: float,
    config: RuleConfig,
    obstacles: tuple[Capsule, ...],
    user: str,
) -> Cut | str:
    """The cut so far along the cane from another one, or why there is none.

    Args:
        known: The vines.
        position: Of the cut as it is (3, m, odom).
        along: Away from the cordon (m).
        config: The rule's numbers.
        obstacles: Wires among them are kept away from.
        user: Who moves it.
    """
    best: tuple[float, KnownSpur, int, float] | None = None
    for spur in known.spurs:
        for number, cane in enumerate(spur.canes):
            arcs, axis = _samples(cane)
            gaps = np.linalg.norm(axis - position, axis=1)
            k = int(np.argmin(gaps))
            if gaps[k] < _ON_CANE and (best is None or gaps[k] < best[0]):
                best = float(gaps[k]), spur, number, float(arcs[k])
    if best is None:
        return "it is on no cane that is known; reject it, and place one by hand"
    _, spur, number, arc = best
    return _cut_at(spur, number, arc + along, config, obstacles, f"Moved by {user}")


def _cut_at(
    spur: KnownSpur, number: int, arc: float, config: RuleConfig, obstacles: tuple[Capsule, ...], whose: str
) -> Cut | str:
    cane = spur.canes[number].as_cane()
    if arc > cane.length:
        return "the cane has been cut there already"
    if arc < float(cane.arc[0]):
        return "the cane begins there"
    position = cane.at(arc)
    nodes = count_nodes(cane, config)
    gaps = [abs(node.arc - arc) for node in cane.nodes]
    if gaps and min(gaps) < _FROM_NODE:
        return f"{1000 * min(gaps):.0f} mm from a node: the blades need {1000 * _FROM_NODE:.0f} mm"
    if 2 * cane.radius > config.largest_diameter:
        return f"the cane is {2000 * cane.radius:.0f} mm thick, more than the shears may cut"
    if near_wire(obstacles, position, config.wire_distance):
        return f"a wire passes within {1000 * config.wire_distance:.0f} mm of there"
    below = [node for node in nodes if node.arc < arc]
    where = f"{1000 * (arc - below[-1].arc):.0f} mm past node {len(below)}" if below else "below the first node"
    return Cut(
        kind="by hand",
        position=position,
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=1.0,
        nodes_seen=len(nodes),
        nodes_kept=len(below),
        reason=f"{whose}: {where} on this cane.",
        offset=arc - below[-1].arc if below else None,
        node_distance=nearest_node(cane, tuple(below), position),
    )


def _samples(cane: KnownCane) -> tuple[Array, Array]:
    """Arc lengths (N, m) and places (N×3, odom) along a cane, closer than its axis's own samples are apart."""
    arcs = np.arange(float(cane.best.arc[0]), cane.best.length, 0.001)
    return arcs, np.stack([np.interp(arcs, cane.best.arc, cane.best.axis[:, i]) for i in range(3)], axis=1)


def _nearest(known: PlantMap, origin: Array, direction: Array) -> tuple[float, KnownSpur, int, float, float] | None:
    """Of all canes the one that a line passes nearest: how far beside it (m), its spur and number, and where.

    That is the arc length there and the distance from the line's beginning (m).
    """
    best: tuple[float, KnownSpur, int, float, float] | None = None
    for spur in known.spurs:
        for number, cane in enumerate(spur.canes):
            arcs, axis = _samples(cane)
            ahead = (axis - origin) @ direction
            gaps = np.linalg.norm(axis - origin - ahead[:, None] * direction, axis=1)
            gaps[ahead <= 0.0] = np.inf
            k = int(np.argmin(gaps))
            if np.isfinite(gaps[k]) and (best is None or gaps[k] < best[0]):
                best = float(gaps[k]), spur, number, float(arcs[k]), float(ahead[k])
    return best
