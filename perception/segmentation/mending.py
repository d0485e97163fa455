"""Depth of thin wood, mended: a pixel on a cane whose depth its neighbours on canes do not share gets theirs.

Along the edge of a cane a stereo camera gives the depth of what is behind or beside it, a mixture, or nothing. Left as
it is, a cane five pixels wide would lose its width, and scattered points would bend its axis.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from perception.config import SkeletonConfig
from perception.segmentation.frame import View
from perception.segmentation.pixels import pixels_of
from rolling_panda.messages.types import WOOD_CLASSES

_THIN = tuple(WOOD_CLASSES.index(kind) for kind in ("cane", "node", "spur"))
#: So many of the eight neighbours must share a pixel's depth.
_SUPPORT = 3
#: Half the side of the window whose supported pixels stand in (px).
_REACH = 2


def mended(view: View, labels: NDArray[np.uint8], config: SkeletonConfig) -> View:
    """The frame with the depth of canes, nodes and spurs mended; what has no supported neighbour loses its depth.

    Args:
        view: The frame.
        labels: H×W class indices.
        config: Range, and what counts as a step in depth.
    """
    rows, cols = pixels_of(labels, _THIN)
    height, width = labels.shape
    own = view.depth[rows, cols]
    own = np.where((own > config.nearest) & (own < config.farthest), own, np.float32(0.0))
    # With an empty border, row after row: every pixel's neighbours are a fixed step away.
    stride = width + 2 * _REACH
    depth = np.zeros((height + 2 * _REACH) * stride, np.float32)
    at = (rows + _REACH) * stride + cols + _REACH
    depth[at] = own
    support = np.zeros(len(rows), dtype=np.int8)
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            if dr or dc:
                beside = depth[at + dr * stride + dc]
                support += (beside > 0.0) & (np.abs(beside - own) < config.depth_step)
    good = (own > 0.0) & (support >= _SUPPORT)
    bad = np.flatnonzero(~good)
    # What is left is trusted.
    depth[at[bad]] = 0.0
    offsets = np.arange(-_REACH, _REACH + 1)
    found = np.sort(depth[at[bad][:, None] + (offsets[:, None] * stride + offsets).ravel()], axis=1)
    count = np.count_nonzero(found, axis=1)
    # Zeros come first in order: the middle of what is behind them.
    middle = found.shape[1] - count + (count - 1) // 2
    out = view.depth.copy()
    out[rows[bad], cols[bad]] = np.where(
        count > 0, found[np.arange(len(found)), np.minimum(middle, found.shape[1] - 1)], np.float32(0.0)
    )
    return replace(view, depth=out)
