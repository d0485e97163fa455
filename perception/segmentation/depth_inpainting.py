"""Depth inpainting on thin wood: wrong depth gets the median of its neighbours, and short holes are bridged.

Along the edge of a cane a stereo camera gives the depth of the background, a mixture, or nothing. Uncorrected, a cane
five pixels wide would lose its width, and scattered points would bend its axis. In low sun whole stretches of a cane
have no depth. Uncorrected, it would fall into pieces too short to have a direction.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.spatial import cKDTree

from perception.arrays import Array, Index, Labels, Mask
from perception.config import SkeletonConfig
from perception.segmentation.frame import CANE, NODE, SPUR, View, class_pixels

#: Number of neighbours, of eight, that must have the depth of a valid pixel.
_MIN_SUPPORT = 3
#: Half the side of the window from which a median is taken (px).
_HALF_WINDOW = 2
#: Longest hole that is bridged (px). A longer one may be wood beyond the sensor's range that crosses nearer wood.
_MAX_HOLE = 48
#: The rim of a hole: so many pixels with depth next to each of its pixels, at most so far away (px).
_RIM_PIXELS, _RIM_WIDTH = 12, 8.0
#: Least number of pixels of a rim.
_MIN_RIM = 6
#: SD of the slope of depth along wood in the image (1/m per px), and of inverse depth about a plane (1/m).
_SLOPE, _SCATTER = 0.0005, 0.004


def inpaint_depth(view: View, labels: Labels, config: SkeletonConfig) -> View:
    """The frame with corrected depth of canes, nodes and spurs; 0 where there is none to correct it from.

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
    own[bad] = np.where(count > 0, found[np.arange(len(found)), middle], np.float32(0.0))
    # Wood out of range has a depth, and is no hole.
    hole = (own <= 0.0) & (view.depth[rows, cols] <= config.min_depth)
    out = view.depth.copy()
    out[rows, cols] = own
    if hole.any():
        _bridge_holes(out, rows, cols, hole, config.depth_step)
    return replace(view, depth=out)


def _bridge_holes(depth: NDArray[np.float32], rows: Index, cols: Index, hole: Mask, step: float) -> None:
    """Give each short hole the plane through its rim, in place.

    Inverse depth is affine over the image of a plane, and along the image of a straight cane.

    Args:
        depth: Depth image, H×W (m); 0 in the holes.
        rows: Row of each pixel of thin wood (N).
        cols: Its column (N).
        hole: Whether it has no depth (N).
        step: Depth step between two canes (m).
    """
    image = np.zeros(depth.shape, dtype=bool)
    image[rows[hole], cols[hole]] = True
    numbered, count = label(image, np.ones((3, 3)))
    short = np.zeros(count + 1, dtype=bool)
    for k, (down, along) in enumerate(find_objects(numbered), 1):
        short[k] = max(down.stop - down.start, along.stop - along.start) <= _MAX_HOLE
    number = numbered[rows, cols]
    known = np.flatnonzero(depth[rows, cols] > 0.0)
    filled = np.flatnonzero(short[number])
    if not (len(known) and len(filled)):
        return
    at = np.stack([rows, cols], axis=1).astype(float)
    distance, beside = cKDTree(at[known]).query(at[filled], _RIM_PIXELS, distance_upper_bound=_RIM_WIDTH, workers=1)
    owner = np.broadcast_to(number[filled][:, None], distance.shape)[np.isfinite(distance)]
    pairs = np.unique(np.stack([owner, known[beside[np.isfinite(distance)]]], axis=1), axis=0)
    hole_of, rim = pairs.T
    if not len(rim):
        return
    z = depth[rows[rim], cols[rim]].astype(float)
    same = np.abs(z - _nearer(hole_of, z, count)[hole_of]) < 2 * step
    hole_of, rim, z = hole_of[same], rim[same], z[same]
    size = np.bincount(hole_of, minlength=count + 1)
    centre = np.stack([np.bincount(hole_of, x, count + 1) for x in (*at[rim].T, 1 / z)]) / np.maximum(size, 1)
    v, u, w = np.array([*at[rim].T, 1 / z]) - centre[:, hole_of]
    # Ridge regression: a rim on one side only must not tilt the plane by its noise.
    vv, uv, uu, vw, uw = (np.bincount(hole_of, x, count + 1) for x in (v * v, u * v, u * u, v * w, u * w))
    ridge = (_SCATTER / _SLOPE) ** 2
    determinant = (vv + ridge) * (uu + ridge) - uv * uv
    slope_v = ((uu + ridge) * vw - uv * uw) / determinant
    slope_u = ((vv + ridge) * uw - uv * vw) / determinant
    filled = filled[size[number[filled]] >= _MIN_RIM]
    k = number[filled]
    inverse = centre[2, k] + slope_v[k] * (rows[filled] - centre[0, k]) + slope_u[k] * (cols[filled] - centre[1, k])
    depth[rows[filled], cols[filled]] = 1.0 / inverse


def _nearer(group: Index, values: Array, count: int) -> Array:
    """A third of the values of each group 0 … `count` are at most this; 0 for a group without any.

    Where canes cross, the rim has the depths of both, and the nearer cane hides the other.
    """
    order = np.lexsort((values, group))
    first = np.searchsorted(group[order], np.arange(count + 1))
    size = np.bincount(group, minlength=count + 1)
    third = np.minimum(first + size // 3, len(values) - 1)
    return np.where(size > 0, values[order][third], 0.0)
