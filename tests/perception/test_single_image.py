"""Pruning points of a single picture."""

import numpy as np
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge
from perception.config import PerceptionConfig
from perception.segmentation.photograph import Photograph
from perception.single_image import read_still

PLACE = np.eye(4)
PLACE[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
PLACE[:3, 3] = [0.5, -0.05, 1.05]


@pytest.fixture(scope="module")
def picture():
    """A row, its picture with the simulator's labels, and where each right cut is."""
    row = grow(VineyardConfig(), 101)
    camera = Camera(CameraConfig(), 101)
    image = camera.render(row, PLACE)
    photograph = Photograph(image.color, image.depth, camera.intrinsics, False, (848, 480))
    return photograph, image.labels, np.array([truth.cut.best for truth in judge(row) if truth.cut is not None])


def test_with_depth_the_cuts_have_places_before_the_camera(picture):
    photograph, labels, right = picture
    still = read_still(photograph, labels, PerceptionConfig())
    cuts = [point.cut for point in still.points if point.cut.kind == "spur cut"]
    assert len(cuts) >= 4 and still.scale == "depth image"
    # A level camera's frame is the world's but for its place.
    gaps = [np.linalg.norm(right - (cut.position + PLACE[:3, 3]), axis=1).min() for cut in cuts]
    assert np.mean(np.array(gaps) < 0.012) >= 0.8


def test_without_depth_they_are_pixels_near_the_same_places(picture):
    photograph, labels, right = picture
    flat = Photograph(photograph.color, None, photograph.intrinsics, True, (848, 480))
    still = read_still(flat, labels, PerceptionConfig())
    points = [point for point in still.points if point.cut.kind == "spur cut"]
    assert len(points) >= 2 and "no depth" in still.scale
    k = photograph.intrinsics
    x, y, z = ((right - PLACE[:3, 3]) @ PLACE[:3, :3]).T
    pixels = np.stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z], axis=1)
    gaps = [np.linalg.norm(pixels - point.pixel, axis=1).min() for point in points]
    # 20 mm are 11 pixels here.
    assert np.median(gaps) < 6.0


def test_a_picture_without_wood_gives_a_reason_and_no_point(picture):
    photograph, labels, _ = picture
    flat = Photograph(photograph.color, None, photograph.intrinsics, True, (848, 480))
    for picture_without in (photograph, flat):
        still = read_still(picture_without, np.zeros_like(labels), PerceptionConfig())
        assert not still.points and "no cane" in still.abstained[0]


def test_depth_that_is_nowhere_on_wood_gives_no_point(picture):
    photograph, labels, _ = picture
    blind = Photograph(photograph.color, np.zeros_like(photograph.depth), photograph.intrinsics, False, (848, 480))
    still = read_still(blind, labels, PerceptionConfig())
    assert not still.points and "no cane with depth" in still.abstained[0]


def test_every_point_has_its_reason_and_a_direction_along_the_wood(picture):
    photograph, labels, _ = picture
    for point in read_still(photograph, labels, PerceptionConfig()).points:
        assert point.cut.reason.endswith(".") and 0.0 < point.cut.confidence <= 1.0
        # Away from the cordon is up in this picture.
        assert point.beyond[1] < point.pixel[1]
