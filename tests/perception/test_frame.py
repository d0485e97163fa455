import zlib

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from perception.segmentation.frame import CorruptFrameError, UnusablePictureError, class_pixels, decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.robot import RobotModel

WIDTH, HEIGHT = 32, 24


@pytest.fixture(scope="module")
def model():
    return RobotModel()


def good_frame(**changes):
    depth = np.full((HEIGHT, WIDTH), 800, dtype="<u2")
    frame = CameraFrame(
        header=m.Header(1.0, "camera"),
        sequence=1,
        intrinsics=Intrinsics(WIDTH, HEIGHT, 20.0, 20.0, 15.5, 11.5),
        base=m.PlanarPose(0.3, 0.0, 0.1),
        position=(0.0, 0.0, 0.0, -0.3, 0.0, -2.2, 1.7, 1.4, 0.0),
        color_jpeg=b"",
        depth_zlib=zlib.compress(depth.tobytes()),
        depth_unit=0.001,
        labels_zlib=zlib.compress(np.zeros((HEIGHT, WIDTH), dtype=np.uint8).tobytes()),
    )
    return msgspec.structs.replace(frame, **changes)


def test_points_and_pixels_are_inverse(model):
    view = decode_frame(good_frame(), model)
    assert view.depth[0, 0] == pytest.approx(0.8)
    points = view.points([3.0, 11.5], [5.0, 15.5], np.array([0.5, 0.8]))
    np.testing.assert_allclose(view.pixels(points), [[5.0, 3.0, 0.5], [15.5, 11.5, 0.8]], atol=1e-9)
    # The middle of the image lies straight ahead of the camera.
    np.testing.assert_allclose(points[1], view.t + 0.8 * view.R[:, 2], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"depth_zlib": b"rubbish"}, "frame_image_corrupt"),
        ({"depth_zlib": b""}, "frame_image_size_wrong"),
        ({"depth_zlib": zlib.compress(b"\0" * 7)}, "frame_image_size_wrong"),
        ({"depth_zlib": zlib.compress(b"\0" * (WIDTH * HEIGHT * 2 + 1))}, "frame_image_size_wrong"),
        ({"depth_zlib": zlib.compress(bytes(1 << 26))}, "frame_image_size_wrong"),
        ({"labels_zlib": zlib.compress(b"\0" * 5)}, "frame_image_size_wrong"),
        ({"labels_zlib": zlib.compress(b"\xff" * (WIDTH * HEIGHT))}, "frame_class_unknown"),
        ({"position": (float("nan"),) * 9}, "frame_posture_invalid"),
        ({"position": (0.0,) * 8}, "frame_posture_invalid"),
        ({"base": m.PlanarPose(float("inf"), 0.0, 0.0)}, "frame_posture_invalid"),
        ({"intrinsics": Intrinsics(WIDTH, HEIGHT, 0.0, 20.0, 15.5, 11.5)}, "frame_intrinsics_invalid"),
        ({"depth_unit": float("nan")}, "frame_depth_unit_invalid"),
    ],
)
def test_a_bad_frame_is_refused(model, changes, code):
    with pytest.raises(CorruptFrameError) as refused:
        decode_frame(good_frame(**changes), model)
    assert refused.value.reason.code == code


def test_a_colour_image_that_is_none_is_refused(model):
    with pytest.raises(CorruptFrameError) as refused:
        decode_frame(good_frame(color_jpeg=b"no picture"), model).color()
    assert refused.value.reason.code == "colour_not_jpeg"


def test_without_labels_the_label_segmenter_says_why(model):
    segmenter = LabelImageSegmenter()
    assert segmenter.name == "simulator labels"
    with pytest.raises(UnusablePictureError) as refused:
        segmenter.segment(decode_frame(good_frame(labels_zlib=b""), model))
    assert refused.value.reason == reasons.frame_without_labels("simulator labels")
    assert segmenter.segment(decode_frame(good_frame(), model)).shape == (HEIGHT, WIDTH)


@given(
    arrays(np.uint8, array_shapes(min_dims=2, max_dims=2), elements=st.integers(0, 4)),
    st.lists(st.integers(0, 4), min_size=1, max_size=3),
)
def test_all_pixels_of_the_classes_and_no_others_row_by_row(labels, kinds):
    rows, cols = class_pixels(labels, tuple(kinds))
    found = list(zip(rows.tolist(), cols.tolist(), strict=True))
    assert found == [(r, c) for r, c in np.ndindex(labels.shape) if labels[r, c] in kinds]


def test_a_window_of_an_image_counts_from_its_own_corner():
    labels = np.zeros((6, 8), np.uint8)
    labels[3, 5] = 2
    rows, cols = class_pixels(labels[2:5, 4:8], (2,))
    assert (rows.tolist(), cols.tolist()) == ([1], [1])
