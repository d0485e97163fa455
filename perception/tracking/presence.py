"""Whether wood is present at a known position, as far as one frame shows."""

from typing import Literal

import numpy as np

from perception.arrays import Array, Labels
from perception.segmentation.frame import ANY_WOOD, CANE, NODE, POST, SPUR, TRUNK, View
from rolling_panda.messages.types import CutKind

#: Largest depth difference of the same wood (m).
_SAME_DEPTH = 0.025
#: Least depth (m): the camera is blind below 0.18 m (D435i), plus the error of a position.
_MIN_DEPTH = 0.25
#: Search radius across the view (m), for errors of odometry.
SEARCH_RADIUS = 0.008
#: A post or trunk so near behind a cane looks like it, and the network takes the cane for a part of it (m).
_ALIKE_BEHIND = 0.15
#: Wood farther behind the position than this belongs to another row (m).
_OTHER_ROW = 0.8

Presence = Literal["present", "gone", "not visible"]


def wood_presence(
    view: View, labels: Labels, positions: Array, aside: float = SEARCH_RADIUS, kind: CutKind = "spur cut"
) -> list[Presence]:
    """Presence of spur, cane or node at positions on the axis of the wood (N×3, m, odom).

    Args:
        view: The frame.
        labels: H×W class indices.
        positions: To check.
        aside: How far aside it may be seen (m).
        kind: Of the cut of that wood. That of a removal may have the class of any wood, and it is not gone where
            anything is at its depth: before bare ground the network loses it.
    """
    return [_at(view, labels, u, v, z, aside, kind == "removal") for u, v, z in view.pixels(positions).tolist()]


def _at(view: View, labels: Labels, u: float, v: float, z: float, aside: float, removal: bool) -> Presence:
    height, width = view.depth.shape
    radius = max(2, round(view.intrinsics.fx * aside / max(z, 0.1)))
    if z < _MIN_DEPTH or not (radius <= u < width - radius - 1 and radius <= v < height - radius - 1):
        return "not visible"
    row, col = round(v), round(u)
    window = slice(row - radius, row + radius + 1), slice(col - radius, col + radius + 1)
    depth = view.depth[window]
    wood = np.isin(labels[window], ANY_WOOD if removal else (CANE, NODE, SPUR))
    here = np.abs(depth - z) < _SAME_DEPTH
    if (wood & here).any():
        return "present"
    if removal and here.any():
        return "not visible"
    nearer = (depth > 0.0) & (depth < z - _SAME_DEPTH)
    undetermined = wood & ((depth == 0.0) | (depth > z + _OTHER_ROW))
    alike = np.isin(labels[window], (POST, TRUNK)) & (depth < z + _ALIKE_BEHIND)
    return "not visible" if (nearer | undetermined | alike).any() else "gone"
