"""Keep-out zones of the blades: wires and hoses beside a cut or in front of it, cordon and trunk."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.arrays import Array, Labels
from perception.config import RuleConfig
from perception.plant.capsules import CapsuleSet, permanent
from perception.segmentation.frame import HOSE, WIRE, View
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import Reason

#: Approximate approach direction: the row runs along x of odom and the robot stands beside it.
APPROACH = np.array([0.0, 1.0, 0.0])
#: Depth in front of the cut (m) that the tool passes through, since the camera looks along the approach.
_IN_FRONT = 0.15
#: Depth behind the cut (m) that the blades reach.
_BEHIND = 0.025


@dataclass(frozen=True)
class KeepOut:
    """Forbidden and unfavourable places of a cut.

    Attributes:
        reason: Why a cut at a position (3, m, odom) is forbidden; None where it is allowed.
        fits: Whether the open blades at a position (3, m, odom) on wood with a tangent (3) have the controller's
            clearance from wires. Otherwise the controller may refuse the cut.
    """

    reason: Callable[[Array], Reason | None]
    fits: Callable[[Array, Array], bool]


#: No restriction.
NO_KEEP_OUT = KeepOut(lambda position: None, lambda position, tangent: True)


def frame_keep_out(view: View, labels: Labels, obstacles: tuple[Capsule, ...], rule: RuleConfig) -> KeepOut:
    """Wires and hoses of one frame; cordons and trunks of the obstacle map.

    Args:
        view: The frame.
        labels: H×W class indices.
        obstacles: Obstacle map.
        rule: Clearances.
    """
    mapped = map_keep_out(obstacles, rule)
    wood_reason = _wood_reason(obstacles, rule)

    def reason(position: Array) -> Reason | None:
        return (
            _wire_reason(rule) if wire_in_image(view, labels, position, rule.wire_distance) else wood_reason(position)
        )

    def fits(position: Array, tangent: Array) -> bool:
        return not wire_beside_blades(view, labels, position, tangent, rule) and mapped.fits(position, tangent)

    return KeepOut(reason, fits)


def map_keep_out(obstacles: tuple[Capsule, ...], rule: RuleConfig) -> KeepOut:
    """Keep-out zones of the obstacle map alone."""
    wires = CapsuleSet(obstacles, ("wire", "hose"))
    wood_reason = _wood_reason(obstacles, rule)

    def reason(position: Array) -> Reason | None:
        near = wires.nearest(position[None])[0] < rule.wire_distance
        return _wire_reason(rule) if near else wood_reason(position)

    def fits(position: Array, tangent: Array) -> bool:
        side = np.cross(tangent, APPROACH)
        side *= rule.blade_reach / max(float(np.linalg.norm(side)), 1e-9)
        blades = np.stack([position - side, position, position + side])
        return bool(np.all(wires.nearest(blades) >= rule.blade_clearance))

    return KeepOut(reason, fits)


def wire_in_image(view: View, labels: Labels, position: Array, distance: float) -> bool:
    """Whether a wire or a hose is visible within `distance` of a cut or in front of it.

    Args:
        view: The frame.
        labels: H×W class indices.
        position: Of the cut (3, m, odom).
        distance: Clearance (m).
    """
    u, v, z = view.pixels(position)[0].tolist()
    radius = distance * view.intrinsics.fx / max(z, 0.1)
    right, down = _wire_pixels(view, labels, (u, v, z), radius)
    return bool(np.any(np.hypot(right, down) <= radius))


def wire_beside_blades(view: View, labels: Labels, position: Array, tangent: Array, rule: RuleConfig) -> bool:
    """Whether a wire or a hose is visible within the clearance of the open blades.

    The blades are on either side of the wood, square to it: on leaning wood one of them is nearer to a level wire.

    Args:
        view: The frame.
        labels: H×W class indices.
        position: Of the cut (3, m, odom).
        tangent: Of the wood there (3, odom).
        rule: Reach and clearance of the blades.
    """
    (u, v, z), (x, y, _) = view.pixels(np.stack([position, position + 0.01 * tangent])).tolist()
    scale = view.intrinsics.fx / max(z, 0.1)
    right, down = _wire_pixels(view, labels, (u, v, z), (rule.blade_reach + rule.blade_clearance) * scale)
    length = max(float(np.hypot(x - u, y - v)), 1e-9)
    along, across = (x - u) / length, (y - v) / length
    beside = np.maximum(np.abs(right * across - down * along) - rule.blade_reach * scale, 0.0)
    return bool(np.any(np.hypot(beside, right * along + down * across) <= rule.blade_clearance * scale))


def _wire_pixels(view: View, labels: Labels, at: tuple[float, float, float], radius: float) -> tuple[Array, Array]:
    """Offsets right and down (px) of wire pixels from a place in the image (u, v, depth), up to `radius` (px)."""
    u, v, z = at
    height, width = view.depth.shape
    rows = slice(max(0, round(v - radius)), min(height, round(v + radius) + 1))
    cols = slice(max(0, round(u - radius)), min(width, round(u + radius) + 1))
    depth = view.depth[rows, cols]
    wire = np.isin(labels[rows, cols], (WIRE, HOSE)) & (depth > z - _IN_FRONT) & (depth < z + _BEHIND)
    row, col = np.nonzero(wire)
    return np.asarray(col + cols.start - u, float), np.asarray(row + rows.start - v, float)


def _wire_reason(rule: RuleConfig) -> Reason:
    return reasons.wire_near_cut(1000 * rule.wire_distance)


def _wood_reason(obstacles: tuple[Capsule, ...], rule: RuleConfig) -> Callable[[Array], Reason | None]:
    stays = permanent(obstacles, rule)
    wood = {kind: CapsuleSet(stays, (kind,)) for kind in ("cordon", "trunk")}

    def reason(position: Array) -> Reason | None:
        for kind, capsules in wood.items():
            if capsules.nearest(position[None])[0] < rule.cordon_distance:
                return reasons.wood_near_cut(kind, 1000 * rule.cordon_distance)
        return None

    return reason
