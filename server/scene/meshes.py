"""Meshes of the 3-D view: the plant's capsules, and the colours of wood and of the points' states."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule

Color = tuple[int, int, int]

#: The list beside the view names the state in words too: colour is not the only sign.
STATE_COLORS: dict[m.PointState, Color] = {
    "PROPOSED": (255, 176, 32),
    "ACCEPTED": (64, 148, 255),
    "UNREACHABLE": (0, 206, 209),
    "CUTTING": (255, 64, 200),
    "DONE": (56, 200, 96),
    "FAILED_NOT_CUT": (240, 60, 50),
    "UNKNOWN": (160, 96, 255),
    "REJECTED": (130, 136, 142),
}
#: Kinds of capsules that are drawn: colour, and number of sides of the mesh.
_KINDS: dict[m.WoodClass, tuple[Color, int]] = {
    "post": ((150, 140, 125), 8),
    "trunk": ((104, 78, 56), 8),
    "cordon": ((116, 86, 60), 8),
    "spur": ((130, 92, 60), 6),
    # There are more than a thousand of each of these, a few pixels wide each.
    "cane": ((178, 124, 74), 4),
    "node": ((206, 156, 98), 4),
    "wire": ((176, 182, 190), 4),
    "hose": ((38, 38, 40), 6),
    "old cut": ((96, 84, 74), 6),
}


#: Length of a capsule's tips, in radii.
_TIP = 0.5
#: Lowest seen end of a trunk or post (m) from which it is drawn down to the ground.
_SEEN_LOW = 0.7


def on_the_ground(capsules: Iterable[Capsule]) -> list[Capsule]:
    """Trunks and posts down to the ground, on which they stand though the camera does not look so low.

    Of each, only the piece that reaches lowest is lengthened.
    """
    rows = list(capsules)
    lowest: dict[tuple[str, int, float], int] = {}
    for number, each in enumerate(rows):
        if each.kind in ("trunk", "post"):
            low = min(each.start, each.end, key=lambda place: place[2])
            key = (each.kind, each.vine, round(low[0], 0))
            at = lowest.get(key)
            if at is None or low[2] < min(rows[at].start[2], rows[at].end[2]):
                lowest[key] = number
    for number in lowest.values():
        each = rows[number]
        flip = each.start[2] <= each.end[2]
        low, radius = (each.start, each.start_radius) if flip else (each.end, each.end_radius)
        if 0.02 < low[2] < _SEEN_LOW:
            rows.append(Capsule(each.kind, (low[0], low[1], 0.0), low, radius, radius))
    return rows


def drawn_kinds() -> tuple[m.WoodClass, ...]:
    """Kinds of capsules that are drawn."""
    return tuple(_KINDS)


def color_of(kind: m.WoodClass, dim: bool = False) -> Color:
    """Colour of a kind, sRGB 0…255; dim for the simulated row, which perception has not seen yet."""
    r, g, b = _KINDS[kind][0]
    return (r, g, b) if not dim else (round(50 + 0.45 * r), round(50 + 0.45 * g), round(50 + 0.45 * b))


def capsules_mesh(
    kind: m.WoodClass, capsules: list[Capsule], grow: float = 0.0
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices (V, 3) in map (m) and faces (F, 3) of capsules. Their blunt tips close the bends between them.

    Args:
        kind: Decides the number of sides.
        capsules: At least one.
        grow: Added to the radius (m).
    """
    sides = _KINDS[kind][1]
    start, end = (np.array([getattr(c, name) for c in capsules]) for name in ("start", "end"))
    radii = np.array([(c.start_radius, c.end_radius) for c in capsules]) + grow
    axis = end - start
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(length > 1e-9, axis / np.maximum(length, 1e-9), [[0.0, 0.0, 1.0]])
    aside = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(axis, aside)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axis, u)
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    around = np.cos(angle)[None, :, None] * u[:, None] + np.sin(angle)[None, :, None] * v[:, None]
    bottom = start[:, None] + radii[:, :1, None] * around
    top = end[:, None] + radii[:, 1:, None] * around
    below = start - _TIP * radii[:, :1] * axis
    above = end + _TIP * radii[:, 1:] * axis
    vertices = np.concatenate([bottom, top, below[:, None], above[:, None]], axis=1)
    faces = _prism_faces(sides)[None] + (np.arange(len(capsules)) * (2 * sides + 2))[:, None, None]
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.uint32)


def _prism_faces(sides: int) -> NDArray[np.int64]:
    i = np.arange(sides)
    j = (i + 1) % sides
    walls = np.concatenate([np.stack([i, j, j + sides], 1), np.stack([i, j + sides, i + sides], 1)])
    below, above = np.full_like(i, 2 * sides), np.full_like(i, 2 * sides + 1)
    return np.concatenate([walls, np.stack([j, i, below], 1), np.stack([i + sides, j + sides, above], 1)])


def quat_wxyz(quat_xyzw: m.QuatXyzw) -> tuple[float, float, float, float]:
    """A message's quaternion in viser's order w, x, y, z."""
    x, y, z, w = quat_xyzw
    return (w, x, y, z)
