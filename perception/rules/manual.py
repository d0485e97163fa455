"""Points placed or moved by an operator, snapped to the nearest known cane."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.arrays import Array, interpolate
from perception.config import RuleConfig
from perception.plant.capsules import CapsuleSet
from perception.plant.map import KnownCane, KnownSpur, PlantMap
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import Cut, count_nodes, node_distance, too_thick
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import Reason

#: Largest distance of a click from a cane (m), and from far away the largest angle (rad).
_MAX_DISTANCE, _MAX_ANGLE = 0.025, 0.012
#: A cut is shifted by up to this along the cane to an allowed place (m), in steps of this.
_MAX_SHIFT, _SHIFT_STEP = 0.016, 0.001
#: Where no known cane is within this distance of the ray (m), that part of the row was not seen.
_MAX_UNSEEN = 0.3
#: Largest distance of a point from the axis of its cane (m).
_ON_CANE = 0.012
#: Distance of nodes from the blades (m).
_NODE_CLEARANCE = 0.010


@dataclass(frozen=True)
class _Hit:
    """A place on a known cane: distance from the query and arc length (m); distance along a ray (m)."""

    distance: float
    spur: KnownSpur
    cane: KnownCane
    arc: float
    range: float


def place_cut(
    known: PlantMap,
    origin: Array,
    direction: Array,
    config: RuleConfig,
    obstacles: tuple[Capsule, ...],
    user: str,
) -> tuple[Cut, SpurNumber] | Reason:
    """The cut on the cane nearest to a ray, or the reason why there is none.

    Args:
        known: The vines.
        origin: Origin of the ray (3, m, odom).
        direction: Unit vector along the ray (3, odom).
        config: Pruning rule.
        obstacles: Obstacle map with the wires.
        user: Name of the operator.
    """

    def distances(axis: Array) -> tuple[Array, Array]:
        ranges = (axis - origin) @ direction
        distances = np.linalg.norm(axis - origin - ranges[:, None] * direction, axis=1)
        distances[ranges <= 0.0] = np.inf
        return distances, ranges

    hit = _nearest(known, distances)
    if hit is None or hit.distance > _MAX_UNSEEN:
        return reasons.row_unseen_there()
    if hit.distance > max(_MAX_DISTANCE, _MAX_ANGLE * hit.range):
        return reasons.click_beside_cane(1000 * hit.distance)
    refused: list[Reason] = []
    for shift in sorted(np.arange(-_MAX_SHIFT, _MAX_SHIFT + _SHIFT_STEP / 2, _SHIFT_STEP).tolist(), key=abs):
        cut = _cut_at(hit, hit.arc + shift, config, obstacles, user, moved=False)
        if isinstance(cut, Cut):
            return cut, hit.spur.number
        refused.append(cut)
    return reasons.click_elsewhere(refused[0], 1000 * _MAX_SHIFT)


def move_cut(
    known: PlantMap,
    position: Array,
    along: float,
    config: RuleConfig,
    obstacles: tuple[Capsule, ...],
    user: str,
) -> Cut | Reason:
    """A cut shifted along its cane, or the reason why there is none.

    Args:
        known: The vines.
        position: Present position of the cut (3, m, odom).
        along: Shift away from the cordon (m).
        config: Pruning rule.
        obstacles: Obstacle map with the wires.
        user: Name of the operator.
    """
    hit = _nearest(known, lambda axis: (np.linalg.norm(axis - position, axis=1), np.zeros(len(axis))))
    if hit is None or hit.distance >= _ON_CANE:
        return reasons.on_no_cane()
    return _cut_at(hit, hit.arc + along, config, obstacles, user, moved=True)


def _cut_at(
    hit: _Hit, arc: float, config: RuleConfig, obstacles: tuple[Capsule, ...], user: str, moved: bool
) -> Cut | Reason:
    cane = hit.cane.as_cane()
    if arc > cane.length:
        return reasons.cut_there_already()
    if arc < float(cane.arc[0]):
        return reasons.cane_begins_there()
    position = cane.at(arc)
    nodes = count_nodes(cane, config)
    to_node = min((abs(node.arc - arc) for node in cane.nodes), default=np.inf)
    if to_node < _NODE_CLEARANCE:
        return reasons.node_too_near(1000 * to_node, 1000 * _NODE_CLEARANCE)
    if too_thick(cane.radius, config):
        return reasons.cane_beyond_shears(2000 * cane.radius)
    if CapsuleSet(obstacles, ("wire", "hose")).nearest(position[None])[0] < config.wire_distance:
        return reasons.wire_passes_there(1000 * config.wire_distance)
    below = [node for node in nodes if node.arc < arc]
    if below:
        past = reasons.moved_past_node if moved else reasons.placed_past_node
        reason = past(user, 1000 * (arc - below[-1].arc), len(below))
    else:
        reason = reasons.moved_below_nodes(user) if moved else reasons.placed_below_nodes(user)
    return Cut(
        kind="by hand",
        position=position,
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=1.0,
        nodes_seen=len(nodes),
        nodes_kept=len(below),
        reason=reason,
        offset=arc - below[-1].arc if below else None,
        node_distance=node_distance(cane, tuple(below), position),
        cane=cane.number,
    )


def _nearest(known: PlantMap, query: Callable[[Array], tuple[Array, Array]]) -> _Hit | None:
    """The nearest of all cane samples, 1 mm apart; `query` gives distances and ranges of an axis."""
    best: _Hit | None = None
    for spur in known.spurs:
        for cane in spur.canes:
            arcs = np.arange(float(cane.best.arc[0]), cane.best.length, 0.001)
            distances, ranges = query(interpolate(arcs, cane.best.arc, cane.best.axis))
            k = int(np.argmin(distances))
            if np.isfinite(distances[k]) and (best is None or distances[k] < best.distance):
                best = _Hit(float(distances[k]), spur, cane, float(arcs[k]), float(ranges[k]))
    return best
