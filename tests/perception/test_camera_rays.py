"""Rays through places in stored frames."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from perception.segmentation.frame import decode_frame
from perception.tracking.camera_rays import CameraRays
from rolling_panda.messages.types import BaseAttitude, PlanarPose
from rolling_panda.model.robot import RobotModel
from tests.perception.test_frame import good_frame

MODEL = RobotModel()
SHARE = st.floats(0.0, 1.0)


@given(u=SHARE, v=SHARE, x=st.floats(-5.0, 5.0), phi=st.floats(-3.0, 3.0), roll=st.floats(-0.1, 0.1))
def test_what_is_on_the_line_is_seen_at_the_place_that_was_clicked(u, v, x, phi, roll):
    rays = CameraRays()
    frame = replace(good_frame(base=PlanarPose(x, 0.0, phi)), attitude=BaseAttitude(0.02, roll, -0.03))
    rays.add(frame)
    ray = rays.ray(1, u, v, MODEL)
    view = decode_frame(frame, MODEL)
    col, row, _ = view.pixels(ray.origin + 0.7 * ray.direction)[0]
    k = frame.intrinsics
    np.testing.assert_allclose([(col + 0.5) / k.width, (row + 0.5) / k.height], [u, v], atol=1e-9)
    assert abs(np.linalg.norm(ray.direction) - 1.0) < 1e-12


def test_a_frame_of_minutes_ago_is_remembered_and_one_of_hours_ago_is_not():
    rays = CameraRays()
    for sequence in range(5000):
        rays.add(replace(good_frame(), sequence=sequence))
    assert rays.ray(4000, 0.5, 0.5, MODEL) is not None
    assert rays.ray(100, 0.5, 0.5, MODEL) is None
