"""Draws cones into images with a depth buffer, compiled by numba."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)  # type: ignore[untyped-decorator]
def draw_cones(
    cones: NDArray[np.float64],
    depth: NDArray[np.float32],
    index: NDArray[np.int32],
    across: NDArray[np.float32],
    along: NDArray[np.float32],
) -> None:
    """Draw cones; a pixel keeps the nearest.

    Args:
        cones: First end (column, row, depth in m, radius in px, radius in m), and the last, of each (N×10).
        depth: H×W (m), written where a cone is nearer.
        index: H×W, the cone.
        across: H×W, -1…1 from one side of the cone to the other.
        along: H×W, 0…1 from its first end to its last.
    """
    height, width = depth.shape
    for n in range(len(cones)):
        x0, y0, z0, r0, m0, x1, y1, z1, r1, m1 = cones[n]
        top = max(r0, r1, 0.5)
        left, right = max(0, int(min(x0, x1) - top)), min(width - 1, int(max(x0, x1) + top) + 1)
        upper, lower = max(0, int(min(y0, y1) - top)), min(height - 1, int(max(y0, y1) + top) + 1)
        if left > right or upper > lower:
            continue
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        length = np.sqrt(square) + 1e-9
        for row in range(upper, lower + 1):
            for col in range(left, right + 1):
                px, py = col - x0, row - y0
                t = (px * dx + py * dy) / square if square > 1e-9 else 0.0
                t = min(1.0, max(0.0, t))
                ex, ey = px - t * dx, py - t * dy
                # Nothing is thinner than a pixel, or thin things would be dotted lines.
                r = max(0.5, r0 + t * (r1 - r0))
                away = np.sqrt(ex * ex + ey * ey)
                if away > r:
                    continue
                s = away / r
                z = z0 + t * (z1 - z0) - (m0 + t * (m1 - m0)) * np.sqrt(1.0 - s * s)
                if z < depth[row, col]:
                    depth[row, col] = z
                    index[row, col] = n
                    across[row, col] = s if (ex * -dy + ey * dx) / length > 0.0 else -s
                    along[row, col] = t
