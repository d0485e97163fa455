"""Depth inpainting on thin wood.

Along the edge of a cane a stereo camera gives the depth of the background, a mixture, or nothing. Uncorrected, a cane
five pixels wide would lose its width, and scattered points would bend its axis: a pixel whose depth differs from its
neighbours' gets their median. In the sun thin wood has no depth in patches, which would cut a cane into pieces: there
the depth is interpolated along the wood.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph, linalg

from perception.arrays import Index, Labels, neighbours
from perception.config import SkeletonConfig
from perception.segmentation.frame import CANE, NODE, SPUR, View, class_pixels

Floats = NDArray[np.float32]

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
    raw = view.depth[rows, cols]
    own = np.where((raw > config.min_depth) & (raw < config.max_depth), raw, np.float32(0.0))
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
    # What is seen beyond the range is another row, and has lost nothing.
    instead = np.where(raw[bad] >= config.max_depth, raw[bad], np.float32(0.0))
    out = view.depth.copy()
    out[rows[bad], cols[bad]] = np.where(count > 0, found[np.arange(len(found)), middle], instead)
    return replace(view, depth=out)


def interpolate_lost_depth(view: View, labels: Labels, config: SkeletonConfig) -> View:
    """The frame with depth of canes, nodes and spurs also where the camera lost it, near to where it has it.

    Args:
        view: The frame, of `inpaint_depth`.
        labels: H×W class indices.
        config: Depth range and reach.
    """
    rows, cols = class_pixels(labels, (CANE, NODE, SPUR))
    before = view.depth[rows, cols] < config.max_depth
    rows, cols = rows[before], cols[before]
    own = view.depth[rows, cols]
    if not (own > 0.0).any():
        return view
    reach = config.depth_reach * view.intrinsics.fx / float(np.median(own[own > 0.0]))
    out = view.depth.copy()
    out[rows, cols] = _interpolated(own, neighbours(labels.shape, rows, cols), reach)
    return replace(view, depth=out)


def _interpolated(own: Floats, pairs: Index, reach: float) -> Floats:
    """Depth of the pixels (N, m); an unknown one is the mean of its neighbours' (Laplace's equation on the wood).

    A cane is a strip in the image: along it that is linear interpolation, and at an end the last depth stays.

    Args:
        own: Depth; 0 = unknown.
        pairs: Neighbouring pixels, P×2.
        reach: Largest distance of an unknown pixel from a known one along the wood (px); farther ones stay unknown.
    """
    known, n = own > 0.0, len(own)
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), (n, n)).tocsr()
    away = csgraph.dijkstra(
        graph, directed=False, indices=np.flatnonzero(known), unweighted=True, min_only=True, limit=reach
    )
    lost = np.isfinite(away) & ~known
    size = int(lost.sum())
    if not size:
        return own
    number = np.cumsum(lost) - 1
    here, beside = np.concatenate([pairs, pairs[:, ::-1]]).T
    counts = lost[here] & (lost[beside] | known[beside])
    here, beside = number[here[counts]], beside[counts]
    inner = lost[beside]
    edges = sparse.coo_matrix((np.ones(int(inner.sum())), (here[inner], number[beside[inner]])), (size, size))
    laplacian = sparse.diags(np.bincount(here, minlength=size).astype(float)) - edges
    border = np.bincount(here[~inner], own[beside[~inner]], minlength=size)
    out = own.copy()
    out[lost] = linalg.spsolve(laplacian.tocsc(), border)
    return out
