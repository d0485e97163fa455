"""Whether wood stands at a known place, as far as one frame can tell."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from perception.plant.model import Array
from perception.segmentation.frame import View
from perception.skeleton.fragments import CANE, NODE
from rolling_panda.messages.types import WOOD_CLASSES

_SPUR = WOOD_CLASSES.index("spur")
#: How far from where it should be wood may be seen and still be the same (m).
_SAME_DEPTH = 0.025
#: A depth camera is blind nearer than this (0.18 m for the D435i), with room for a point off its place (m).
_NEAREST = 0.25
#: How far to the side of where it should be it is looked for (m): odometry and a close view are off by millimetres.
_AROUND = 0.008
#: Wood of this row is not so much farther away than a place on it (m).
_OTHER_ROW = 0.8

Glance = Literal["standing", "gone", "unseen"]


def glance(view: View, labels: NDArray[np.uint8], place: Array) -> Glance:
    """Look for spur, cane or node at a place.

    Args:
        view: The frame.
        labels: Its classes, H×W.
        place: On the wood's axis (3, m, odom).
    """
    return glances(view, labels, place)[0]


def glances(view: View, labels: NDArray[np.uint8], places: Array) -> list[Glance]:
    """The same for many places at once (N×3, m, odom)."""
    return [_at(view, labels, u, v, z) for u, v, z in view.pixels(places).tolist()]


def _at(view: View, labels: NDArray[np.uint8], u: float, v: float, z: float) -> Glance:
    height, width = view.depth.shape
    reach = max(2, round(view.intrinsics.fx * _AROUND / max(z, 0.1)))
    if z < _NEAREST or not (reach <= u < width - reach - 1 and reach <= v < height - reach - 1):
        return "unseen"
    row, col = round(v), round(u)
    window = slice(row - reach, row + reach + 1), slice(col - reach, col + reach + 1)
    depth, kind = view.depth[window], labels[window]
    wood = (kind == CANE) | (kind == NODE) | (kind == _SPUR)
    if (wood & (np.abs(depth - z) < _SAME_DEPTH)).any():
        return "standing"
    # Nearer things hide the place, and wood without depth, or with that of another row, is nowhere.
    if (wood & ((depth == 0.0) | (depth > z + _OTHER_ROW))).any() or ((depth > 0.0) & (depth < z - _SAME_DEPTH)).any():
        return "unseen"
    return "gone"
