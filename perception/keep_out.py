"""Where the blades must not go: wires and hoses beside the cut or in the way to it, cordon and trunk."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from perception.clearance import Rods, clearance
from perception.config import RuleConfig
from perception.frame import View
from perception.plant import Array
from rolling_panda.messages import WOOD_CLASSES, WoodClass
from rolling_panda.row_messages import Capsule

#: Why the blades must not come to a place (3, m, odom); empty where they may.
KeepOut = Callable[[Array], str]

_LINES = (WOOD_CLASSES.index("wire"), WOOD_CLASSES.index("hose"))
_LINE_KINDS: tuple[WoodClass, ...] = ("wire", "hose")
_OLD_WOOD: tuple[WoodClass, ...] = ("cordon", "trunk")
#: The camera looks along the approach, so what is this much nearer than the cut lies in the tool's way (m).
_WAY_IN = 0.15
#: Depth beyond the cut that the blades still reach (m).
_BEHIND = 0.025


def anywhere(place: Array) -> str:
    """Nothing is known that the blades must keep away from."""
    return ""


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

    return reason


def as_known(obstacles: tuple[Capsule, ...], rule: RuleConfig) -> KeepOut:
    """The same from what is known of all frames, without an image."""
    wood = _old_wood(obstacles)

    def reason(place: Array) -> str:
        if near_wire(obstacles, place, rule.wire_distance):
            return _beside_wire(rule)
        return _beside_wood(wood, place, rule)

    return reason


def wire_near(view: View, labels: NDArray[np.uint8], position: Array, distance: float) -> bool:
    """Whether a wire or a hose is seen within `distance` of a cut, or of the way in to it.

    Args:
        view: The frame.
        labels: H×W class indices.
        position: Of the cut, in odom (3, m).
        distance: Keep-out (m).
    """
    u, v, z = view.pixels(position)[0]
    height, width = view.depth.shape
    reach = distance * view.intrinsics.fx / max(z, 0.1)
    rows = slice(max(0, round(v - reach)), min(height, round(v + reach) + 1))
    cols = slice(max(0, round(u - reach)), min(width, round(u + reach) + 1))
    depth = view.depth[rows, cols]
    wire = np.isin(labels[rows, cols], _LINES) & (depth > z - _WAY_IN) & (depth < z + _BEHIND)
    row, col = np.nonzero(wire)
    return bool(np.any(np.hypot(row + rows.start - v, col + cols.start - u) <= reach))


def near_wire(obstacles: tuple[Capsule, ...], position: Array, distance: float) -> bool:
    """Whether a known wire or hose is within `distance` (m) of a place (3, m, odom)."""
    gaps = (clearance(obstacles, kind, position) for kind in _LINE_KINDS)
    return any(gap is not None and gap < distance for gap in gaps)


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
