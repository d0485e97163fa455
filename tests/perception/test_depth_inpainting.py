"""Depth along the edges of canes."""

import dataclasses
import functools

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.arrays import distance
from perception.config import SkeletonConfig
from perception.segmentation.depth_inpainting import inpaint_depth, interpolate_lost_depth
from perception.segmentation.frame import View
from perception.skeleton.topology import perceive_plant, trace_canes
from rolling_panda import messages as m

CANE = m.WOOD_CLASSES.index("cane")


def frame(config: CameraConfig) -> View:
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [0.5, 0.0, 1.1]
    camera = Camera(config, 5)
    image = camera.render(grow(VineyardConfig(), 5), place)
    return View(0, 0.0, camera.intrinsics, image.depth, image.labels, b"", place[:3, :3], place[:3, 3])


@pytest.mark.long
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


@functools.cache
def seen_without_errors() -> View:
    return frame(CameraConfig().ideal())


def strip(depth):
    """A cane of three columns, whose depth by rows is given (m)."""
    view = seen_without_errors()
    labels, image = np.zeros_like(view.labels), np.zeros_like(view.depth)
    labels[50 : 50 + len(depth), 100:103] = CANE
    image[50 : 50 + len(depth), 100:103] = np.array(depth, np.float32)[:, None]
    mend = inpaint_depth(dataclasses.replace(view, depth=image), labels, SkeletonConfig())
    mend = interpolate_lost_depth(mend, labels, SkeletonConfig())
    return mend.depth[50 : 50 + len(depth), 101]


def test_depth_that_is_lost_on_a_stretch_is_interpolated_along_the_wood():
    true = 0.70 + 0.001 * np.arange(40)
    seen = np.where((np.arange(40) >= 15) & (np.arange(40) < 29), 0.0, true)
    assert np.abs(strip(seen) - true).max() < 0.0025
    # 20 mm are 12 px here: between two that are farther apart it stays unknown, and nothing is made up beyond an end.
    long = strip(np.concatenate([np.full(20, 0.7), np.zeros(60), np.full(20, 0.7)]))
    assert (long[:30] > 0.0).all() and (long[-30:] > 0.0).all()
    assert (long[35:65] == 0.0).all()
    assert np.abs(long[long > 0.0] - 0.7).max() < 1e-5


def test_wood_beyond_the_range_takes_no_depth_from_what_is_before_it():
    behind = strip(np.concatenate([np.full(20, 0.7), np.full(20, 2.0)]))
    assert (behind[24:] == np.float32(2.0)).all()
    between = strip(np.concatenate([np.full(20, 0.7), np.zeros(6), np.full(20, 2.0)]))
    assert between[20:26] == pytest.approx(0.7, abs=1e-4), "lost depth is not a mixture of both rows"


def test_a_stretch_without_depth_is_followed_by_a_survey_and_counts_as_hidden():
    view = seen_without_errors()
    whole = perceive_plant(view, view.labels, SkeletonConfig())
    spur, cane = max(((s, c) for s in whole.spurs for c in s.canes), key=lambda each: each[1].length)
    at = int(np.argmin(np.abs(cane.arc - 0.12)))
    u, v, _ = view.pixels(cane.axis[at : at + 1])[0]
    lost = view.depth.copy()
    lost[round(v) - 8 : round(v) + 8, round(u) - 15 : round(u) + 15] = 0.0
    holed = dataclasses.replace(view, depth=lost)
    seen = min(
        perceive_plant(holed, view.labels, SkeletonConfig()).spurs, key=lambda s: distance(s.position, spur.position)
    )
    same = max(seen.canes, key=lambda c: c.length)
    assert same.length == pytest.approx(cane.length, abs=0.02)
    assert any(span.start < 0.12 < span.end for span in same.hidden)
    assert not any(span.start < 0.12 < span.end for span in cane.hidden)
    pieces, canes = (trace_canes(each, view.labels, SkeletonConfig()) for each in (holed, view))
    assert len(pieces) == len(canes), "a close-up follows it as well"
    assert len(trace_canes(holed, view.labels, SkeletonConfig(), measured_only=True)) > len(canes)


@given(lost=st.lists(st.booleans(), min_size=60, max_size=60), near=st.floats(0.3, 1.0), far=st.floats(0.3, 1.0))
def test_an_interpolated_depth_is_between_those_that_were_seen(lost, near, far):
    seen = np.where(lost, 0.0, np.linspace(near, far, 60))
    mend = strip(seen)
    known = seen[seen > 0.0]
    if len(known):
        inside = mend[mend > 0.0]
        assert (inside >= known.min() - 1e-4).all() and (inside <= known.max() + 1e-4).all()
    else:
        assert not mend.any()
