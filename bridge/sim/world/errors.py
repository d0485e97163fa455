"""Errors of one robot and its place, which stay the same for a seed: how it was built, calibrated and put down."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from bridge.sim.vineyard.row import Array
from bridge.sim.world.config import WorldConfig

#: Wheels of one axle wear alike: their radii differ by this share of the error that they have in common.
_UNEQUAL = 0.1
_STREAM = 0x3012


@dataclass(frozen=True)
class Errors:
    """True quantity against the one that the program believes.

    Attributes:
        hand_eye: Rotation of the camera on the tool (3×3), in the camera's frame.
        hand_eye_shift: Its position (3, m), in the camera's frame.
        focal: Factor of the focal length.
        joint_offset: Measured less true angle of each joint of the arm (7, rad).
        mount: Pose of the arm on the base (pin.SE3), in the frame of its foot.
        wheels: Factors of the wheels' radii (2), left and right.
        track: Factor of the track.
        slope: Slope of the ground along and across the row (2, rad).
    """

    hand_eye: Array
    hand_eye_shift: Array
    focal: float
    joint_offset: Array
    mount: pin.SE3
    wheels: Array
    track: float
    slope: Array


def draw_errors(config: WorldConfig, seed: int) -> Errors:
    """Draw the errors. Each has a random stream of its own, so that one does not depend on the size of another."""

    def stream(number: int) -> np.random.Generator:
        return np.random.default_rng([seed, _STREAM, number])

    wheels = stream(4)
    common, apart = wheels.uniform(-1.0, 1.0), wheels.uniform(-1.0, 1.0) * _UNEQUAL / 2
    return Errors(
        hand_eye=pin.exp3(config.hand_eye_angle * stream(0).standard_normal(3)),
        hand_eye_shift=config.hand_eye_shift * stream(1).standard_normal(3),
        focal=1.0 + config.focal_error * float(stream(2).uniform(-1.0, 1.0)),
        joint_offset=config.joint_offset * stream(3).standard_normal(7),
        mount=pin.SE3(
            pin.exp3(config.mount_angle * stream(5).standard_normal(3)),
            config.mount_shift * stream(6).standard_normal(3),
        ),
        wheels=1.0 + config.wheel_error * np.array([common + apart, common - apart]),
        track=1.0 + config.wheel_error * float(wheels.uniform(-1.0, 1.0)),
        slope=stream(7).uniform(-1.0, 1.0, 2) * [config.slope_along, config.slope_across],
    )
