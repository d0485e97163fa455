"""Lines of canes from their pixels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.config import SkeletonConfig
from perception.segmentation.frame import View
from perception.skeleton.centreline import centrelines
from perception.skeleton.fragments import CanePixels
from rolling_panda.messages.robot import Intrinsics

CONFIG = SkeletonConfig()
SHAPE = (240, 160)
LENS = Intrinsics(160, 240, 500.0, 500.0, 80.0, 120.0)
AHEAD = 0.5


def seen(up: tuple[float, float]) -> tuple[View, CanePixels]:
    """An upright cane 0.5 m ahead, of which only the pixels between two heights (m) are told."""
    depth = np.full(SHAPE, AHEAD, np.float32)
    view = View(0, 0.0, LENS, depth, None, b"", np.eye(3), np.zeros(3))
    rows, cols = np.mgrid[0 : SHAPE[0], 78:83].reshape(2, -1)
    points = view.points(rows, cols, np.full(len(rows), AHEAD))
    told = (-points[:, 1] >= up[0]) & (-points[:, 1] <= up[1])
    n = int(told.sum())
    none = np.zeros(n, bool)
    pixels = CanePixels(
        SHAPE,
        rows[told],
        cols[told],
        np.full(n, AHEAD),
        points[told],
        none,
        ~none,
        none.astype(int),
        np.empty((0, 2), int),
    )
    return view, pixels


def upright(length: float) -> np.ndarray:
    """A chain along it, from its base at height 0 (m)."""
    heights = np.linspace(0.0, length, 8)
    return np.stack([np.zeros(8), -heights, np.full(8, AHEAD)], axis=1)


def test_a_cane_lies_along_its_pixels():
    (line,) = centrelines(*seen((-0.02, 0.12)), [upright(0.1)], CONFIG)
    np.testing.assert_allclose(line.axis[:, 0], 0.0, atol=0.003)
    assert -line.axis[[0, -1], 1] == pytest.approx([0.0, 0.1], abs=0.01)


@given(st.floats(-0.02, -0.006), st.floats(0.012, 0.02))
def test_pixels_that_all_lie_before_a_line_give_none(lowest, length):
    # They have no direction: a line through them would lead anywhere.
    assert centrelines(*seen((lowest, -0.001)), [upright(length)], CONFIG) == []
