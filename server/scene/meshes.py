"""Meshes of the 3-D view: the plant's capsules, the markers of pruning points, and their colours."""

import numpy as np
import pinocchio as pin
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
    """Vertices (V, 3) in odom (m) and faces (F, 3) of capsules, drawn with flat ends.

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
    vertices = np.concatenate([bottom, top], axis=1)
    faces = _prism_faces(sides)[None] + (np.arange(len(capsules)) * 2 * sides)[:, None, None]
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.uint32)


def _prism_faces(sides: int) -> NDArray[np.int64]:
    i = np.arange(sides)
    j = (i + 1) % sides
    walls = np.concatenate([np.stack([i, j, j + sides], 1), np.stack([i, j + sides, i + sides], 1)])
    fan = np.arange(1, sides - 1)
    lid = np.stack([np.zeros_like(fan), fan, fan + 1], 1)
    return np.concatenate([walls, lid[:, ::-1], lid + sides])


def quat_wxyz_of_axis(axis: m.UnitVector3) -> NDArray[np.float64]:
    """The shortest rotation of z onto `axis`, in viser's order w, x, y, z."""
    x, y, z, w = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(axis)).coeffs()
    return np.array([w, x, y, z])


def quat_wxyz(quat_xyzw: m.QuatXyzw) -> tuple[float, float, float, float]:
    """A message's quaternion in viser's order w, x, y, z."""
    x, y, z, w = quat_xyzw
    return (w, x, y, z)
