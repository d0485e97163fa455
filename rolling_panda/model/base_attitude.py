"""The base on uneven ground: its height, roll and pitch, beside its pose on the plane.

The configuration q has the base on the plane, level. So whatever is computed from q is in odom as if the base stood
level; `T_odom_level` leads from there to odom.
"""

import math
from typing import Any

import numpy as np
import pinocchio as pin

from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.types import MOST_TILT, BaseAttitude, PlanarPose
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel, configuration, on_plane


def rotation(attitude: BaseAttitude) -> Array:
    """Rotation (3×3) from base_link to the frame of its pose on the plane."""
    out: Array = pin.exp3(np.array([0.0, attitude.pitch, 0.0])) @ pin.exp3(np.array([attitude.roll, 0.0, 0.0]))
    return out


def attitude_of(R: Array, height: float) -> tuple[BaseAttitude, float]:
    """Attitude at a height (m), and heading (rad, within ±π), of a base with a rotation R_odom_base (3×3).

    Roll and pitch are bounded to what a message can tell.
    """
    pitch = min(max(-math.asin(min(max(R[2, 0], -1.0), 1.0)), -MOST_TILT), MOST_TILT)
    roll = min(max(math.atan2(R[2, 1], R[2, 2]), -MOST_TILT), MOST_TILT)
    return BaseAttitude(height, roll, pitch), math.atan2(R[1, 0], R[0, 0])


def T_odom_base(base: PlanarPose, attitude: BaseAttitude | None = None) -> Any:
    """The base in odom (pin.SE3): its pose on the plane, and how it stands there."""
    T_odom_footprint = on_plane(np.array([base.x, base.y, base.phi]))
    if attitude is None:
        return T_odom_footprint
    return T_odom_footprint * pin.SE3(rotation(attitude), np.array([0.0, 0.0, attitude.height]))


def T_odom_level(base: PlanarPose, attitude: BaseAttitude | None) -> Any | None:
    """Where things are in odom (pin.SE3) that are computed with the base level at `base`; None where that is odom."""
    if attitude is None or attitude == BaseAttitude():
        return None
    return T_odom_base(base, attitude) * T_odom_base(base).inverse()


def camera_in_odom(frame: CameraFrame, model: RobotModel) -> Any:
    """T_odom_camera (pin.SE3) when a frame was taken; the model's `data` is overwritten."""
    camera = model.pose(configuration(frame.base, frame.position), model.camera_id)
    T = T_odom_level(frame.base, frame.attitude)
    return camera if T is None else T * camera
