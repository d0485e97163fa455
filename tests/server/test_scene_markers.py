from typing import get_args

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rolling_panda import messages as m
from server.scene.markers import STATE_COLORS, beyond_marker, cut_marker, quat_wxyz, quat_wxyz_of_axis

PART = st.floats(-1.0, 1.0)


@settings(max_examples=100)
@given(st.tuples(PART, PART, PART).filter(lambda axis: np.linalg.norm(axis) > 0.1))
def test_the_markers_axis_lies_along_the_cane(axis):
    assert z_turned_by(quat_wxyz_of_axis(axis)) == pytest.approx(np.array(axis) / np.linalg.norm(axis), abs=1e-6)


@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (0.0, 2e-5, -1.0), (1e-7, 0.0, -1.0), (0.0, 0.0, 1.0)])
def test_a_cane_that_hangs_straight_down_or_nearly_so_has_a_marker_too(axis):
    assert z_turned_by(quat_wxyz_of_axis(axis)) == pytest.approx(np.array(axis), abs=1e-6)


def z_turned_by(quat_wxyz):
    w, x, y, z = quat_wxyz
    return pin.Quaternion(w, x, y, z).toRotationMatrix() @ np.array([0.0, 0.0, 1.0])


def test_viser_takes_the_scalar_first():
    assert quat_wxyz((0.1, 0.2, 0.3, 0.9)) == (0.9, 0.1, 0.2, 0.3)


def test_every_state_has_a_colour_of_its_own():
    assert set(STATE_COLORS) == set(get_args(m.PointState))
    assert len(set(STATE_COLORS.values())) == len(STATE_COLORS)


def test_the_marker_is_wider_than_a_cane_and_centred_on_the_cut():
    low, high = cut_marker().bounds
    assert high[0] > 0.015
    assert low == pytest.approx(-high, abs=1e-6)


def test_what_cannot_be_reached_has_a_shape_of_its_own_in_the_same_place():
    cut, beyond = cut_marker(), beyond_marker()
    assert beyond.bounds[0] == pytest.approx(-beyond.bounds[1], abs=1e-6)
    assert np.ptp(beyond.bounds[:, 0]) == pytest.approx(np.ptp(cut.bounds[:, 0]), rel=0.2), "as large"
    # A disc has a surface between the bars of a cross.
    assert beyond.volume > 0 and not beyond.contains([[0.03, 0.0, 0.0]])[0] and cut.contains([[0.03, 0.0, 0.0]])[0]
