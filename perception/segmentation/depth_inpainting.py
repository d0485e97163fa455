"""Depth inpainting on thin wood: a pixel whose depth differs from its neighbours' gets their median.

Along the edge of a cane a stereo camera gives the depth of the background, a mixture, or nothing. Uncorrected, a cane
five pixels wide would lose its width, and scattered points would bend its axis.
"""

from dataclasses import replace

import numpy as np

from perception.arrays import Labels
from perception.config import SkeletonConfig
from perception.segmentation.frame import CANE, NODE, SPUR, View, class_pixels

#: Number of neighbours, of eight, that must have the depth of a valid pixel.
_MIN_SUPPORT = 3
#: Half the side of the window from which a median is taken (px).
_HALF_WINDOW = 2


def inpaint_depth(view: View, labels: Labels, config: SkeletonConfig) -> View:
    """The frame with corrected depth of canes, nodes and spurs; 0 where no valid neighbour is in the window.

    Args:
        view: The frame.
        labels: H×W class indices.
        config: Depth range and depth step.
    """
    rows, cols = class_pixels(labels, (CANE, NODE, SPUR))
    height, width = labels.shape
    own = view.depth[rows, cols]
    own = np.where((own > config.min_depth) & (own < config.max_depth), own, np.float32(0.0))
    # Flattened with an empty border, so that every neighbour is at a constant offset.
    stride = width + 2 * _HALF_WINDOW
    depth = np.zeros((height + 2 * _HALF_WINDOW) * stride, np.float32)
    at = (rows + _HALF_WINDOW) * stride + cols + _HALF_WINDOW
    depth[at] = own
    support = np.zeros(len(rows), dtype=np.int8)
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            if dr or dc:
                beside = depth[at + dr * stride + dc]
                support += (beside > 0.0) & (np.abs(beside - own) < config.depth_step)
    bad = np.flatnonzero((own <= 0.0) | (support < _MIN_SUPPORT))
    depth[at[bad]] = 0.0
    offsets = np.arange(-_HALF_WINDOW, _HALF_WINDOW + 1)
    found = np.sort(depth[at[bad][:, None] + (offsets[:, None] * stride + offsets).ravel()], axis=1)
    count = np.count_nonzero(found, axis=1)
    # Zeros are sorted first: the lower median of the rest.
    middle = np.minimum(found.shape[1] - count + (count - 1) // 2, found.shape[1] - 1)
    out = view.depth.copy()
    out[rows[bad], cols[bad]] = np.where(count > 0, found[np.arange(len(found)), middle], np.float32(0.0))
    return replace(view, depth=out)
