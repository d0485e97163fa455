import io
import zlib

import msgspec
import numpy as np
import pytest
from PIL import Image

from rolling_panda import messages as m
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from server.scene.camera_view import decode_frame

WIDTH, HEIGHT = 640, 480
LENS = Intrinsics(WIDTH, HEIGHT, 600.0, 500.0, 320.0, 240.0)


def frame(depth):
    """Red on the left half, blue on the right."""
    color = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    color[:, : WIDTH // 2, 0] = color[:, WIDTH // 2 :, 2] = 255
    jpeg = io.BytesIO()
    Image.fromarray(color).save(jpeg, "JPEG", quality=95)
    return CameraFrame(
        header=m.Header(), sequence=1, intrinsics=LENS, base=m.PlanarPose(), position=(0.0,) * 9,
        color_jpeg=jpeg.getvalue(), depth_zlib=zlib.compress(depth.astype("<u2").tobytes()), depth_unit=1e-3,
    )  # fmt: skip


def test_points_lie_where_depth_and_lens_put_them_with_the_images_colours():
    decoded = decode_frame(frame(np.full((HEIGHT, WIDTH), 1500)))
    assert decoded.points[:, 2] == pytest.approx(1.5)
    assert np.abs(decoded.points[:, 0]).max() == pytest.approx(1.5 * 320 / 600, rel=0.03)
    assert np.abs(decoded.points[:, 1]).max() == pytest.approx(1.5 * 240 / 500, rel=0.03)
    left = decoded.points[:, 0] < -0.05
    assert (decoded.colors[left][:, 0] > 200).all() and (decoded.colors[left][:, 2] < 60).all()
    assert 3000 < len(decoded.points) < 12000


def test_what_gave_no_return_or_is_far_away_is_left_out():
    depth = np.zeros((HEIGHT, WIDTH))
    depth[:, :320] = 4000
    depth[:240, 320:] = 900
    decoded = decode_frame(frame(depth))
    assert len(decoded.points) and decoded.points[:, 2] == pytest.approx(0.9)
    assert (decoded.points[:, 0] >= 0.0).all() and (decoded.points[:, 1] <= 0.0).all()


def test_the_image_in_the_frustum_has_the_lens_angle_and_shape():
    decoded = decode_frame(frame(np.zeros((HEIGHT, WIDTH))))
    assert len(decoded.points) == 0
    assert decoded.fov == pytest.approx(2 * np.arctan2(240, 500))
    height, width, _ = decoded.image.shape
    assert width / height == pytest.approx(WIDTH / HEIGHT, rel=0.02) and width < 300


@pytest.mark.parametrize(
    "broken", [{"color_jpeg": b"no picture"}, {"depth_zlib": b"no depth"}, {"depth_zlib": zlib.compress(b"short")}]
)
def test_a_frame_that_cannot_be_decoded_is_not_drawn(broken):
    assert decode_frame(msgspec.structs.replace(frame(np.full((HEIGHT, WIDTH), 900)), **broken)) is None
