"""Which cane grows from which spur."""

import numpy as np
import pytest

from perception.config import SkeletonConfig
from perception.segmentation.frame import View
from perception.skeleton.topology import perceive_plant
from rolling_panda import messages as m
from rolling_panda.messages.robot import Intrinsics

LENS = Intrinsics(width=320, height=320, fx=450.0, fy=450.0, cx=159.5, cy=159.5)
KIND = m.WOOD_CLASSES.index
#: Pixels from one end of a 20 mm stretch to the other, 0.8 m away.
CAP = 11


def vine(cap: str) -> View:
    """A cordon with one upright spur, whose last 20 mm are of another class, and a cane on top of it."""
    labels, depth = np.zeros((320, 320), np.uint8), np.full((320, 320), 3.0, np.float32)

    def paint(rows: slice, cols: slice, kind: str) -> None:
        labels[rows, cols], depth[rows, cols] = KIND(kind), 0.8

    paint(slice(290, 300), slice(10, 310), "cordon")
    paint(slice(250, 290), slice(153, 165), "spur")
    paint(slice(250 - CAP, 250), slice(153, 165), cap)
    paint(slice(0, 250 - CAP), slice(157, 162), "cane")
    for row in (215, 170, 125, 80, 35):
        paint(slice(row - 3, row + 4), slice(155, 164), "node")
    R = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return View(1, 0.0, LENS, depth, labels, b"", R, np.zeros(3))


@pytest.mark.parametrize("cap", ["spur", "old cut"])
def test_a_cane_on_an_old_cut_grows_from_the_stub_below_it(cap: str) -> None:
    seen = vine(cap)
    assert seen.labels is not None
    (spur,) = perceive_plant(seen, seen.labels, SkeletonConfig()).spurs
    (cane,) = spur.canes
    assert cane.base_gap < 0.022 and len(cane.nodes) == 5
    assert spur.axis is not None and np.linalg.norm(spur.axis[1] - spur.axis[0]) > 0.08


def test_an_old_cut_by_itself_is_no_spur() -> None:
    seen = vine("spur")
    assert seen.labels is not None
    seen.labels[seen.labels == KIND("spur")] = KIND("old cut")
    assert perceive_plant(seen, seen.labels, SkeletonConfig()).spurs == ()


@pytest.mark.parametrize("behind", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("share", [0.1, 0.35])
def test_a_stub_is_measured_by_its_wood_and_not_by_what_the_camera_mixed_with_the_background(
    behind: float, share: float
) -> None:
    """Mixed pixels, at the edge of wood, have a depth between wood and background."""
    seen = vine("spur")
    assert seen.labels is not None
    rows, cols = np.nonzero(seen.labels == KIND("spur"))
    rng = np.random.default_rng(1)
    mixed = rng.random(len(rows)) < share
    seen.depth[rows[mixed], cols[mixed]] += rng.uniform(0.0, behind, mixed.sum()).astype(np.float32)
    (spur,) = perceive_plant(seen, seen.labels, SkeletonConfig()).spurs
    assert spur.axis is not None
    root, tip = spur.axis
    along = (tip - root) / np.linalg.norm(tip - root)
    pixel = 0.8 / LENS.fy
    # Upright, from the cordon to the cane: 51 pixels high and 12 wide.
    assert along[2] > 0.99
    assert np.linalg.norm(tip - root) == pytest.approx(51 * pixel, rel=0.1)
    assert spur.radius == pytest.approx(6 * pixel, rel=0.15)
    assert abs(spur.position[1] - 0.8) < 0.015


def test_of_hardly_any_wood_the_stub_is_all_that_is_seen() -> None:
    seen = vine("spur")
    assert seen.labels is not None
    rows, cols = np.nonzero(seen.labels == KIND("spur"))
    seen.depth[rows, cols] = np.linspace(0.4, 2.0, len(rows), dtype=np.float32)
    (spur,) = perceive_plant(seen, seen.labels, SkeletonConfig()).spurs
    assert np.isfinite(spur.position).all()
