"""Outlines of the markers of pruning points: a shape for each kind of state, so that colour is not the only sign.

All are flat and 1 wide and high, in the axes of a camera: x to the right, y down, z away from it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from rolling_panda import messages as m

MarkerShape = Literal["proposed", "accepted", "unreachable", "done", "decide", "left"]
#: Shape of each state. A cut that is under way is drawn as the accepted one that it is.
SHAPE_OF: Final[dict[m.PointState, MarkerShape]] = {
    "PROPOSED": "proposed",
    "ACCEPTED": "accepted",
    "CUTTING": "accepted",
    "UNREACHABLE": "unreachable",
    "DONE": "done",
    "FAILED_NOT_CUT": "decide",
    "UNKNOWN": "decide",
    "REJECTED": "left",
}

_Point = tuple[float, float]
#: Segments of a full circle.
_ROUND = 28
#: How far the coloured parts and the sign lie in front of the white edge; farther than a depth buffer's error.
_LAYER = 0.02


@dataclass(frozen=True)
class Flat:
    """Triangles of one marker's layer: vertices (V, 3) and faces (F, 3), seen from −z."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


@dataclass(frozen=True)
class Marker:
    """Layers of a marker: `tint` in the state's colour, `white` the edge and the sign, `glass` what is seen through."""

    tint: Flat
    white: Flat
    glass: Flat | None = None


def polygon(corners: Sequence[_Point], z: float) -> Flat:
    """A convex polygon."""
    vertices = np.array([(x, y, z) for x, y in corners], np.float32)
    fan = np.arange(1, len(corners) - 1)
    return Flat(vertices, np.stack([np.zeros_like(fan), fan + 1, fan], axis=1).astype(np.uint32))


def disc(radius: float, z: float, centre: _Point = (0.0, 0.0)) -> Flat:
    """A disc."""
    return polygon([(centre[0] + radius * x, centre[1] + radius * y) for x, y in _circle(_ROUND)], z)


def ring(outer: float, inner: float, z: float) -> Flat:
    """A ring."""
    around = np.array(_circle(_ROUND))
    rim = np.concatenate([outer * around, inner * around])
    vertices = np.column_stack([rim, np.full(len(rim), z)]).astype(np.float32)
    i = np.arange(_ROUND)
    j = (i + 1) % _ROUND
    faces = np.concatenate([np.stack([i, j + _ROUND, j], 1), np.stack([i, i + _ROUND, j + _ROUND], 1)])
    return Flat(vertices, faces.astype(np.uint32))


def stroke(points: Sequence[_Point], width: float, z: float) -> Flat:
    """A line with round ends and corners."""
    half, parts = 0.5 * width, []
    for (x0, y0), (x1, y1) in zip(points, points[1:], strict=False):
        length = math.hypot(x1 - x0, y1 - y0)
        dx, dy = half * (y0 - y1) / length, half * (x1 - x0) / length
        parts.append(polygon([(x0 - dx, y0 - dy), (x1 - dx, y1 - dy), (x1 + dx, y1 + dy), (x0 + dx, y0 + dy)], z))
    return together(*parts, *(disc(half, z, point) for point in points))


def together(*parts: Flat) -> Flat:
    """Several parts as one."""
    start = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + np.uint32(first) for part, first in zip(parts, start, strict=False)]
    return Flat(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def _circle(count: int) -> list[_Point]:
    return [(math.cos(angle), math.sin(angle)) for angle in np.linspace(0.0, math.tau, count, endpoint=False)]


def _square(half: float) -> list[_Point]:
    return [(half, half), (-half, half), (-half, -half), (half, -half)]


def _diamond(half: float) -> list[_Point]:
    return [(half, 0.0), (0.0, half), (-half, 0.0), (0.0, -half)]


_CHECK: Final = ((-0.21, 0.02), (-0.06, 0.18), (0.22, -0.16))
_BIG_CHECK: Final = ((-0.36, 0.04), (-0.1, 0.3), (0.36, -0.28))
_QUESTION: Final = (
    (-0.12, -0.13),
    (-0.08, -0.21),
    (0.02, -0.24),
    (0.12, -0.18),
    (0.12, -0.08),
    (0.01, 0.0),
    (0.0, 0.08),
)
_CROSS: Final = (((-0.32, -0.32), (0.32, 0.32)), ((0.32, -0.32), (-0.32, 0.32)))


def _cross(width: float, z: float) -> Flat:
    return together(*(stroke(line, width, z) for line in _CROSS))


#: A ring that shows the cane behind it; a full disc with a tick; a square with a bar; a tick alone; a diamond with a
#: question mark; a cross.
MARKERS: Final[dict[MarkerShape, Marker]] = {
    "proposed": Marker(
        ring(0.46, 0.27, -_LAYER),
        together(ring(0.5, 0.44, 0.0), ring(0.28, 0.23, 0.0)),
        disc(0.3, 0.5 * _LAYER),
    ),
    "accepted": Marker(disc(0.44, -_LAYER), together(disc(0.5, 0.0), stroke(_CHECK, 0.12, -2 * _LAYER))),
    "unreachable": Marker(
        polygon(_square(0.39), -_LAYER),
        together(polygon(_square(0.46), 0.0), stroke(((-0.22, 0.0), (0.22, 0.0)), 0.15, -2 * _LAYER)),
    ),
    "done": Marker(stroke(_BIG_CHECK, 0.17, -_LAYER), stroke(_BIG_CHECK, 0.28, 0.0)),
    "decide": Marker(
        polygon(_diamond(0.47), -_LAYER),
        together(
            polygon(_diamond(0.56), 0.0),
            stroke(_QUESTION, 0.08, -2 * _LAYER),
            disc(0.05, -2 * _LAYER, (0.0, 0.2)),
        ),
    ),
    "left": Marker(_cross(0.1, -_LAYER), _cross(0.18, 0.0)),
}
#: Around the chosen marker.
HALO: Final = (ring(0.72, 0.6, 0.0), ring(0.78, 0.54, 0.5 * _LAYER))
