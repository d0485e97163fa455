"""Array types and vector operations of the package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Labels = NDArray[np.uint8]


def distance(a: Array, b: Array) -> float:
    """Euclidean distance of two points (3)."""
    return float(np.linalg.norm(a - b))


def interpolate(at: Array, arc: Array, axis: Array) -> Array:
    """Points (K×3) at arc lengths `at` (K) of a polyline (N×3) with arc lengths `arc` (N); the ends are held."""
    return np.stack([np.interp(at, arc, axis[:, i]) for i in range(3)], axis=1)
