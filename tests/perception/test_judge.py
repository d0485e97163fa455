"""Agreement of classes with masks that people drew."""

import numpy as np
import pytest

from perception.models.judge import Agreement, compared, edge
from perception.segmentation.frame import BACKGROUND, CANE, CORDON, NODE, OLD_CUT, SPUR, TRUNK


def stripe(first: int, last: int, size: int = 60) -> np.ndarray:
    out = np.zeros((size, size), bool)
    out[:, first:last] = True
    return out


def agreement(true, told, tolerance=3.0, likely=None):
    out = Agreement()
    out.add(true, told, tolerance, likely)
    return out.figures()


def test_what_is_off_by_no_more_than_the_tolerance_is_found_and_right():
    near, far = agreement(stripe(20, 24), stripe(23, 27)), agreement(stripe(20, 24), stripe(28, 32))
    assert (near["recall"], near["precision"]) == (1.0, 1.0) and near["iou"] == pytest.approx(1 / 7)
    # Columns 20 and 21 are further than three pixels from column 25; 28 is 5 from 23.
    assert agreement(stripe(20, 24), stripe(25, 29))["recall"] == 0.5
    assert (far["recall"], far["precision"], far["f"]) == (0.0, 0.0, 0.0)


def test_recall_misses_what_is_not_told_and_precision_counts_what_is_not_there():
    half = stripe(20, 24)
    half[30:] = False
    missed = agreement(stripe(20, 24), half, 0.0)
    assert (missed["recall"], missed["precision"]) == (0.5, 1.0)
    invented = agreement(half, stripe(20, 24), 0.0)
    assert (invented["recall"], invented["precision"]) == (1.0, 0.5)


def test_figures_of_nothing_are_none_and_not_zero():
    nothing = np.zeros((60, 60), bool)
    assert agreement(nothing, nothing) == dict.fromkeys(("recall", "precision", "f", "iou", "boundary_f", "ece"))
    assert agreement(stripe(3, 9), nothing)["recall"] == 0.0 and agreement(stripe(3, 9), nothing)["precision"] is None


def test_a_boundary_is_where_a_mask_ends_but_not_where_the_picture_does():
    assert np.flatnonzero(edge(stripe(20, 24))[0]).tolist() == [20, 23]
    assert np.flatnonzero(edge(stripe(0, 5))[0]).tolist() == [4]
    # A stripe three times as wide contains the true one, and has its boundaries elsewhere.
    assert agreement(stripe(25, 35), stripe(15, 45))["boundary_f"] == 0.0
    assert agreement(stripe(25, 35), stripe(24, 36))["boundary_f"] == 1.0


def test_calibration_error_is_the_gap_between_what_was_said_and_what_was_so():
    true, told = stripe(0, 30), stripe(0, 60)
    assert agreement(true, told, likely=np.full((60, 60), 0.5))["ece"] == pytest.approx(0.0, abs=1e-9)
    assert agreement(true, told, likely=np.full((60, 60), 0.9))["ece"] == pytest.approx(0.4)
    split = np.where(true, 0.95, 0.05)
    assert agreement(true, told, likely=split)["ece"] == pytest.approx(0.05)
    certain = agreement(told, told, likely=np.ones((60, 60)))
    assert certain["ece"] == pytest.approx(0.0)


def test_pictures_add_up_pixel_by_pixel():
    both = Agreement()
    both.add(stripe(0, 10), stripe(0, 10), 0.0)
    both.add(stripe(0, 30), stripe(40, 50), 0.0)
    assert both.figures()["recall"] == 0.25 and both.figures()["precision"] == 0.5


def test_kinds_of_wood_that_people_do_not_tell_apart_are_one():
    told = np.array([[BACKGROUND, TRUNK, CORDON, OLD_CUT, CANE, NODE, SPUR]], np.uint8)
    nothing = {name: np.zeros((1, 7), bool) for name in ("trunk", "cane", "cordon")}
    said = {name: np.flatnonzero(mask[0]).tolist() for name, _, mask in compared(nothing, told)}
    assert said == {
        "trunk": [1],
        "cane": [4, 5, 6],
        "cordon": [2, 3],
        "trunk and cordon": [1, 2, 3],
        "wood": [1, 2, 3, 4, 5, 6],
    }
