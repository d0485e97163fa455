"""Where the blades must not go: wires and hoses beside the cut or in the way to it, cordon and trunk."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.config import RuleConfig
from perception.plant.clearance import Rods, clearance
from perception.plant.model import Array
from perception.segmentation.frame import View
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

_LINES = (WOOD_CLASSES.index("wire"), WOOD_CLASSES.index("hose"))
_LINE_KINDS: tuple[WoodClass, ...] = ("wire", "hose")
_OLD_WOOD: tuple[WoodClass, ...] = ("cordon", "trunk")
#: The row runs along x of odom and the robot stands beside it, so that this is about where the tool points.
_INWARDS = np.array([0.0, 1.0, 0.0])
#: The camera looks along the approach, so what is this much nearer than the cut lies in the tool's way (m).
_WAY_IN = 0.15
#: Depth beyond the cut that the blades still reach (m).
_BEHIND = 0.025


@dataclass(frozen=True)
class KeepOut:
    """Where the blades must not come, and where they had better not.

    Attributes:
        reason: Why they must not come to a place (3, m, odom); empty where they may.
        fits: Whether open blades about a place (3, m, odom) on wood of a direction (3) stand as clear of the wires as
            the controller keeps them. Where they do not, it may refuse the cut.
    """

    reason: Callable[[Array], str]
    fits: Callable[[Array, Array], bool]


#: Nothing is known that the blades must keep away from.
ANYWHERE = KeepOut(lambda place: "", lambda place, tangent: True)


def in_view(view: View, labels: NDArray[np.uint8], obstacles: tuple[Capsule, ...], rule: RuleConfig) -> KeepOut:
    """What a frame shows of wires and hoses, and what is known of cordon and trunks.

    Args:
        view: The frame.
        labels: H×W class indices.
        obstacles: Known from all frames.
        rule: Distances to keep.
    """
    wood = _old_wood(obstacles)

    def reason(place: Array) -> str:
        if wire_near(view, labels, place, rule.wire_distance):
            return _beside_wire(rule)
        return _beside_wood(wood, place, rule)

    as_known = _fitting(obstacles, rule)

    def fits(place: Array, tangent: Array) -> bool:
        return not wire_beside_blades(view, labels, place, tangent, rule) and as_known(place, tangent)

    return KeepOut(reason, fits)


def as_known(obstacles: tuple[Capsule, ...], rule: RuleConfig) -> KeepOut:
    """The same from what is known of all frames, without an image."""
    wood = _old_wood(obstacles)

    def reason(place: Array) -> str:
        if near_wire(obstacles, place, rule.wire_distance):
            return _beside_wire(rule)
        return _beside_wood(wood, place, rule)

    return KeepOut(reason, _fitting(obstacles, rule))


def wire_near(view: View, labels: NDArray[np.uint8], position: Array, distance: float) -> bool:
    """Whether a wire or a hose is seen within `distance` of a cut, or of the way in to it.

    Args:
        view: The frame.
        labels: H×W class indices.
        position: Of the cut, in odom (3, m).
        distance: Keep-out (m).
    """
    u, v, z = view.pixels(position)[0].tolist()
    reach = distance * view.intrinsics.fx / max(z, 0.1)
    right, down = _wire_pixels(view, labels, (u, v, z), reach)
    return bool(np.any(np.hypot(right, down) <= reach))


def wire_beside_blades(
    view: View, labels: NDArray[np.uint8], position: Array, tangent: Array, rule: RuleConfig
) -> bool:
    """Whether a wire or a hose is seen nearer to the open blades of a cut than they have room.

    They stand to either side of the wood, square to it: where it leans, one is nearer to a level wire than the cut is.

    Args:
        view: The frame.
        labels: H×W class indices.
        position: Of the cut, in odom (3, m).
        tangent: Of the wood there, in odom (3).
        rule: How far the blades reach, and their room.
    """
    (u, v, z), (x, y, _) = view.pixels(np.stack([position, position + 0.01 * tangent])).tolist()
    scale = view.intrinsics.fx / max(z, 0.1)
    right, down = _wire_pixels(view, labels, (u, v, z), (rule.blade_reach + rule.blade_room) * scale)
    length = max(float(np.hypot(x - u, y - v)), 1e-9)
    along, across = (x - u) / length, (y - v) / length
    beside = np.maximum(np.abs(right * across - down * along) - rule.blade_reach * scale, 0.0)
    return bool(np.any(np.hypot(beside, right * along + down * across) <= rule.blade_room * scale))


def _wire_pixels(
    view: View, labels: NDArray[np.uint8], at: tuple[float, float, float], reach: float
) -> tuple[Array, Array]:
    """How far right and down of a place in the image (u, v, depth) wires are seen about it, as far as `reach` (px)."""
    u, v, z = at
    height, width = view.depth.shape
    rows = slice(max(0, round(v - reach)), min(height, round(v + reach) + 1))
    cols = slice(max(0, round(u - reach)), min(width, round(u + reach) + 1))
    depth = view.depth[rows, cols]
    wire = np.isin(labels[rows, cols], _LINES) & (depth > z - _WAY_IN) & (depth < z + _BEHIND)
    row, col = np.nonzero(wire)
    right = np.asarray(col + cols.start - u, dtype=np.float64)
    down = np.asarray(row + rows.start - v, dtype=np.float64)
    return right, down


def near_wire(obstacles: tuple[Capsule, ...], position: Array, distance: float) -> bool:
    """Whether a known wire or hose is within `distance` (m) of a place (3, m, odom)."""
    gaps = (clearance(obstacles, kind, position) for kind in _LINE_KINDS)
    return any(gap is not None and gap < distance for gap in gaps)


def _fitting(obstacles: tuple[Capsule, ...], rule: RuleConfig) -> Callable[[Array, Array], bool]:
    """The open blades stand to either side of the wood: where it leans, one is nearer to a level wire than the cut."""
    lines = [Rods(obstacles, kind) for kind in _LINE_KINDS]

    def fits(place: Array, tangent: Array) -> bool:
        side = np.cross(tangent, _INWARDS)
        side *= rule.blade_reach / max(float(np.linalg.norm(side)), 1e-9)
        places = np.stack([place - side, place, place + side])
        gaps = [gap for rods in lines for gap in rods.clearances(places)]
        return all(gap is None or gap >= rule.blade_room for gap in gaps)

    return fits


def _beside_wire(rule: RuleConfig) -> str:
    return f"a wire or hose passes within {1000 * rule.wire_distance:.0f} mm of the cut; cut this one by hand"


def _old_wood(obstacles: tuple[Capsule, ...]) -> dict[WoodClass, Rods]:
    return {kind: Rods(obstacles, kind) for kind in _OLD_WOOD}


def _beside_wood(wood: dict[WoodClass, Rods], place: Array, rule: RuleConfig) -> str:
    for kind, rods in wood.items():
        gap = rods.clearance(place)
        if gap is not None and gap < rule.cordon_distance:
            return f"the {kind} is within {1000 * rule.cordon_distance:.0f} mm of the cut; cut this one by hand"
    return ""
