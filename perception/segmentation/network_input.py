"""What the segmentation network is given: the same numbers in training and at work."""

import numpy as np
from numpy.typing import NDArray

#: Red, green, blue, nearness.
CHANNELS = 4
#: Depths below this are no measurement (m).
_NEAREST = 0.15


def network_input(color: NDArray[np.uint8], depth: NDArray[np.floating] | None) -> NDArray[np.float32]:
    """The network's image (4×H×W): colours -1…1, and nearness 0.2 m / depth, 0 where there is no depth.

    Args:
        color: H×W×3, RGB.
        depth: H×W (m); None for a photograph without.
    """
    height, width = color.shape[:2]
    out = np.zeros((CHANNELS, height, width), np.float32)
    out[:3] = color.transpose(2, 0, 1)
    out[:3] *= np.float32(2.0 / 255.0)
    out[:3] -= np.float32(1.0)
    if depth is not None:
        np.divide(np.float32(0.2), depth, out=out[3], where=depth > _NEAREST, dtype=np.float32)
    return out
