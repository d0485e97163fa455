"""Depth along the edges of canes."""

import dataclasses

import msgspec
import numpy as np

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
