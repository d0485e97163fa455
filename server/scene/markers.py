"""Shapes of the 3-D view that stand for points: a cut marker, a selection ring, and the colour of each state."""

import math

import numpy as np
import pinocchio as pin
import trimesh
from numpy.typing import NDArray

from rolling_panda import messages as m

Color = tuple[int, int, int]

#: Also told apart by the list beside the view, which has words: colour is not the only sign.
STATE_COLORS: dict[m.PointState, Color] = {
    "PROPOSED": (255, 176, 32),
    "ACCEPTED": (64, 148, 255),
    "UNREACHABLE": (0, 206, 209),
    "INTENT": (255, 64, 200),
    "DONE": (56, 200, 96),
    "FAILED_NOT_CUT": (240, 60, 50),
    "UNKNOWN": (160, 96, 255),
    "REJECTED": (130, 136, 142),
}
_DISC_RADIUS = 0.034
_DISC_HEIGHT = 0.004
_BALL_RADIUS = 0.016
_CROSS = (0.25 * math.pi, -0.25 * math.pi)


def cut_marker() -> trimesh.Trimesh:
    """A disc in the cutting plane around a ball; the cane's tangent is z, the origin is the cut (m)."""
    disc = trimesh.creation.cylinder(radius=_DISC_RADIUS, height=_DISC_HEIGHT, sections=24)
    ball = trimesh.creation.icosphere(subdivisions=1, radius=_BALL_RADIUS)
    return trimesh.util.concatenate([disc, ball])


def beyond_marker() -> trimesh.Trimesh:
    """Two crossed bars in the cutting plane, for what cannot be reached; in the frame of a cut marker (m)."""
    long, wide = 2.4 * _DISC_RADIUS, 0.014
    bar = trimesh.creation.box((long, wide, wide))
    bars = [bar.copy().apply_transform(trimesh.transformations.rotation_matrix(turn, (0, 0, 1))) for turn in _CROSS]
    return trimesh.util.concatenate(bars)


def selection_ring() -> trimesh.Trimesh:
    """A ring around a cut marker, in the same frame."""
    return trimesh.creation.torus(major_radius=0.052, minor_radius=0.004, major_sections=32, minor_sections=8)


def quat_wxyz_of_axis(axis: m.UnitVector3) -> NDArray[np.float64]:
    """The shortest rotation of z onto `axis`, as viser takes it: w, x, y, z."""
    x, y, z, w = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(axis)).coeffs()
    return np.array([w, x, y, z])


def quat_wxyz(quat_xyzw: m.QuatXyzw) -> tuple[float, float, float, float]:
    """Viser's order of the wire's quaternion."""
    x, y, z, w = quat_xyzw
    return (w, x, y, z)
