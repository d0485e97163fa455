"""Array types and operations of the package on vectors and pixels."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Labels = NDArray[np.uint8]

#: Half of the eight neighbours: each pair of pixels once.
_HALF_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


def distance(a: Array, b: Array) -> float:
    """Euclidean distance of two points (3)."""
    return float(np.linalg.norm(a - b))


def interpolate(at: Array, arc: Array, axis: Array) -> Array:
    """Points (K×3) at arc lengths `at` (K) of a polyline (N×3) with arc lengths `arc` (N); the ends are held."""
    return np.stack([np.interp(at, arc, axis[:, i]) for i in range(3)], axis=1)


def neighbours(shape: tuple[int, ...], rows: Index, cols: Index) -> Index:
    """Pairs of neighbouring pixels, as indices of the N given ones (rows, columns), P×2; each pair once."""
    height, width = shape
    stride = width + 2
    number = np.full((height + 1) * stride, -1, dtype=np.int32)
    at = rows * stride + cols + 1
    number[at] = np.arange(len(rows))
    out = []
    for dr, dc in _HALF_NEIGHBOURS:
        beside = number[at + dr * stride + dc]
        here = np.flatnonzero(beside >= 0)
        out.append(np.stack([here, beside[here].astype(np.intp)], axis=1))
    return np.concatenate(out)
