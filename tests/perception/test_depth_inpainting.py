"""Depth along the edges of canes."""

import dataclasses

import msgspec
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import SkeletonConfig
from perception.segmentation.depth_inpainting import inpaint_depth
from perception.segmentation.frame import View
from rolling_panda import messages as m

CANE = m.WOOD_CLASSES.index("cane")


def frame(config: CameraConfig) -> View:
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [0.5, 0.0, 1.1]
    camera = Camera(config, 5)
    image = camera.render(grow(VineyardConfig(), 5), place)
    return View(0, 0.0, camera.intrinsics, image.depth, image.labels, b"", place[:3, :3], place[:3, 3])


def test_canes_get_back_the_depth_that_bled_and_keep_the_rest():
    exact = frame(CameraConfig().ideal())
    bled = frame(msgspec.structs.replace(CameraConfig().ideal(), edge_bleed=0.4))
    mend = inpaint_depth(bled, bled.labels, SkeletonConfig())
    cane = exact.labels == CANE
    wrong, left = (np.abs(view.depth - exact.depth)[cane] > 0.015 for view in (bled, mend))
    assert wrong.mean() > 0.1
    assert left.mean() < 0.25 * wrong.mean()
    thin = np.isin(exact.labels, [m.WOOD_CLASSES.index(kind) for kind in ("cane", "node", "spur")])
    assert np.array_equal(mend.depth[~thin], bled.depth[~thin])


def test_a_lone_pixel_of_cane_loses_its_depth():
    view = frame(CameraConfig().ideal())
    labels = np.zeros_like(view.labels)
    labels[100, 100] = CANE
    depth = np.full_like(view.depth, 0.8)
    lone = inpaint_depth(dataclasses.replace(view, depth=depth), labels, SkeletonConfig())
    assert lone.depth[100, 100] == 0.0 and lone.depth[100, 101] == np.float32(0.8)


def picture(depth: np.ndarray, labels: np.ndarray) -> View:
    intrinsics = Camera(CameraConfig()).intrinsics
    return View(0, 0.0, intrinsics, depth.astype(np.float32), labels, b"", np.eye(3), np.zeros(3))


def leaning_cane(lean: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth and classes of a cane five pixels wide, 1.2 m away, whose inverse depth grows by `lean` a row."""
    labels = np.zeros((480, 848), dtype=np.uint8)
    labels[100:300, 400:405] = CANE
    depth = np.where(labels == CANE, 1 / (1 / 1.2 + lean * (np.arange(480)[:, None] - 200)), 3.5)
    return depth, labels


@given(
    lean=st.floats(-5e-4, 5e-4),
    length=st.integers(4, 30),
    begin=st.integers(20, 150),
    noise=st.integers(0, 2**32 - 1),
)
def test_a_stretch_of_cane_without_depth_is_bridged_along_the_cane(lean: float, length: int, begin: int, noise: int):
    depth, labels = leaning_cane(lean)
    hole = np.zeros_like(labels, dtype=bool)
    hole[100 + begin : 100 + begin + length] = labels[100 + begin : 100 + begin + length] == CANE
    measured = depth + np.random.default_rng(noise).normal(0.0, 0.004, depth.shape) * (labels == CANE)
    view = picture(np.where(hole, 0.0, measured), labels)
    bridged = inpaint_depth(view, labels, SkeletonConfig()).depth
    assert np.abs(bridged - depth)[hole].max() < 0.015


def test_a_hole_takes_the_depth_of_its_own_cane_and_not_of_one_that_crosses_behind_it():
    depth, labels = leaning_cane(0.0)
    labels[180:183, 300:500] = CANE
    depth = np.where((labels == CANE) & (depth > 2.0), 1.5, depth)
    hole = np.zeros_like(labels, dtype=bool)
    hole[175:188, 400:405] = True
    bridged = inpaint_depth(picture(np.where(hole, 0.0, depth), labels), labels, SkeletonConfig()).depth
    assert np.abs(bridged - depth)[175:188, 402].max() < 0.01


def test_wood_without_any_depth_gets_none_from_nearer_wood_that_it_touches():
    """A cane beyond the sensor's range that crosses one within it."""
    depth, labels = leaning_cane(0.0)
    labels[180:183, 300:500] = CANE
    depth = np.where((labels == CANE) & (depth > 2.0), 0.0, depth)
    left = inpaint_depth(picture(depth, labels), labels, SkeletonConfig()).depth
    assert not left[180:183, 300:395].any() and not left[180:183, 410:500].any()


def test_a_hole_far_from_all_depth_stays_one():
    depth, labels = leaning_cane(0.0)
    labels[20:40, 50:55] = CANE
    depth[20:40, 50:55] = 0.0
    assert not inpaint_depth(picture(depth, labels), labels, SkeletonConfig()).depth[20:40, 50:55].any()
