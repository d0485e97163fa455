"""Tool poses of a cut: blade plane square to the cane, approach from the side of the robot."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array

#: An approach this close to the cane's direction is undefined.
_LEAST_SINE = 0.2


@dataclass(frozen=True)
class CutPoses:
    """The poses T_odom_tool (pin.SE3) of one cut, on one line: `clear` of the canes, `stand_off`, and the `cut`."""

    clear: Any
    stand_off: Any
    cut: Any


def cut_poses(
    position: Array,
    tangent: Array,
    towards_row: Array,
    stand_off: float,
    clearance: float,
    azimuth: float = 0.0,
    tilt: float = 0.0,
) -> CutPoses:
    """The poses of a cut.

    Args:
        position: Point on the cane's axis (3, m, odom).
        tangent: Unit vector along the cane (3, odom), either sense.
        towards_row: Horizontal unit vector from the robot's path to the row (3, odom).
        stand_off: Distance back from the cut (m).
        clearance: Distance back where the tool is clear of the canes (m).
        azimuth: Turn of the approach about the cane (rad); 0 is closest to `towards_row`.
        tilt: Turn of the tool out of the plane square to the cane (rad); positive comes from below.

    Raises:
        InputError: The cane points at the robot, so that no approach is square to it.
    """
    axis = tangent / np.linalg.norm(tangent)
    flat = towards_row - axis * float(axis @ towards_row)
    length = float(np.linalg.norm(flat))
    if length < _LEAST_SINE:
        raise InputError("the cane points straight at the robot: no approach is square to it")
    # The tool's y axis points down, so that the camera sits above the blades.
    down = -axis if axis[2] >= 0.0 else axis
    approach = pin.exp3(axis * azimuth) @ (flat / length)
    side = np.cross(down, approach)
    rotation = np.column_stack([side, down, approach])
    if tilt:
        rotation = pin.exp3(side * tilt) @ rotation
        approach = rotation[:, 2]

    def back(distance: float) -> Any:
        return pin.SE3(rotation, position - distance * approach)

    return CutPoses(back(clearance), back(stand_off), back(0.0))


def escape_pose(T_odom_tool: Any, towards_row: Array, depth: float) -> Any:
    """The tool pose after a straight retreat, so that it is `depth` (m) nearer to the robot's path; same orientation.

    The retreat is along the tool's own axis where that leads away from the row, else square to the row.
    """
    back = -T_odom_tool.rotation[:, 2]
    away = -float(back @ towards_row)
    direction, cosine = (back, away) if away > 0.5 else (-towards_row, 1.0)
    return pin.SE3(T_odom_tool.rotation, T_odom_tool.translation + direction * (depth / cosine))
