"""Where the blades must not go: wires beside the cut or in the way to it, as the camera sees them."""

import numpy as np
from numpy.typing import NDArray

from perception.frame import View
from perception.plant import Array
from rolling_panda.messages import WOOD_CLASSES

_WIRE = WOOD_CLASSES.index("wire")
#: The camera looks along the approach, so what is this much nearer than the cut lies in the tool's way (m).
_WAY_IN = 0.15
#: Depth beyond the cut that the blades still reach (m).
_BEHIND = 0.025


def wire_near(view: View, labels: NDArray[np.uint8], position: Array, distance: float) -> bool:
    """Whether a wire is seen within `distance` of a cut, or of the way in to it.

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
    wire = (labels[rows, cols] == _WIRE) & (depth > z - _WAY_IN) & (depth < z + _BEHIND)
    row, col = np.nonzero(wire)
    return bool(np.any(np.hypot(row + rows.start - v, col + cols.start - u) <= reach))
