"""How far a cut is from what the blades must not touch."""

import numpy as np

from perception.plant import Array
from rolling_panda.messages import WoodClass
from rolling_panda.row_messages import Capsule


def clearance(obstacles: tuple[Capsule, ...], kind: WoodClass, place: Array) -> float | None:
    """Distance (m) from a place (3, m, odom) to the surface of the nearest known rod of a kind; None without any.

    It is negative inside a rod.
    """
    rods = [rod for rod in obstacles if rod.kind == kind]
    if not rods:
        return None
    start, end = np.array([rod.start for rod in rods]), np.array([rod.end for rod in rods])
    radii = np.array([(rod.start_radius, rod.end_radius) for rod in rods])
    axis, off = end - start, place - start
    length = np.maximum(np.einsum("ij,ij->i", axis, axis), 1e-12)
    share = np.clip(np.einsum("ij,ij->i", off, axis) / length, 0.0, 1.0)
    gaps = np.linalg.norm(off - share[:, None] * axis, axis=1)
    return float(np.min(gaps - radii[:, 0] - share * (radii[:, 1] - radii[:, 0])))
