"""Camera frames of a row without a bridge, as the bridge would send them: for tests and benchmarks of perception."""

import msgspec
import numpy as np

from bridge.config import BridgeConfig
from bridge.core.picture import encode_picture
from bridge.sim.camera.renderer import Camera, RgbdImage
from bridge.sim.vineyard.row import Array, Row
from rolling_panda import messages as m
from rolling_panda.config import load_section
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.resources import resource


def survey_arm() -> tuple[float, ...]:
    """The survey posture of the arm (7, rad), in which the simulation starts."""
    return load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig).start_arm


def survey_place(x: float = 0.0, arm: tuple[float, ...] | None = None) -> tuple[m.PlanarPose, m.Actuated]:
    """The base at `x` along the row (m, odom), and wheels and arm with the arm in a posture; None is `survey_arm`."""
    return m.PlanarPose(x, 0.0, 0.0), msgspec.convert((0.0, 0.0, *(arm or survey_arm())), m.Actuated)


def camera_pose(model: RobotModel, base: m.PlanarPose, position: m.Actuated) -> Array:
    """Pose of the camera in odom, T_odom_camera (4×4)."""
    T_odom_camera: Array = model.pose(configuration(base, position), model.camera_id).homogeneous
    return T_odom_camera


def camera_frame(
    image: RgbdImage, camera: Camera, base: m.PlanarPose, position: m.Actuated, sequence: int
) -> CameraFrame:
    """The message of an image."""
    picture = encode_picture(camera.intrinsics, image.color, image.depth, image.labels)
    return CameraFrame(
        header=m.Header(float(sequence), "camera"),
        sequence=sequence,
        intrinsics=camera.intrinsics,
        base=base,
        position=position,
        color_jpeg=picture.color_jpeg,
        depth_zlib=picture.depth_zlib,
        depth_unit=picture.depth_unit,
        labels_zlib=picture.labels_zlib,
    )


def survey_frame(
    camera: Camera,
    row: Row,
    model: RobotModel,
    sequence: int,
    x: float = 0.0,
    arm: tuple[float, ...] | None = None,
    offsets: Array | None = None,
) -> CameraFrame:
    """Frame number `sequence` of a row, from `survey_place(x, arm)` by encoders that are off by `offsets` (7, rad)."""
    base, position = survey_place(x, arm)
    true = position
    if offsets is not None:
        _, true = survey_place(x, tuple((np.array(position[2:]) - offsets).tolist()))
    return camera_frame(camera.render(row, camera_pose(model, base, true), sequence), camera, base, position, sequence)
