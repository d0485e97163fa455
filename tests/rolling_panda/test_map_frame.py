"""Map and odom: each conversion has its inverse, and without drift changes nothing."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, Localisation
from rolling_panda.model.map_frame import MapFrame

CANE = Capsule("cane", (0.4, 0.75, 0.9), (0.4, 0.75, 1.0), 0.004, 0.003, 2, 1, True)
UP = np.array([0.0, 0.0, 1.0])
lengths, turns = st.floats(-20.0, 20.0), st.floats(-3.0, 3.0)
frames = st.builds(
    lambda x, y, turn: MapFrame(pin.SE3(pin.exp3(turn * UP), np.array([x, y, 0.0]))), lengths, lengths, turns
)


def told(pose: m.Pose) -> Localisation:
    return Localisation(header=m.Header(1.0, "map"), state="located", T_map_odom=pose, covariance=(0.0,) * 6)


def test_where_odom_is_map_nothing_is_touched():
    drifted = MapFrame().after(told(m.Pose((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    frame = drifted.after(told(m.Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    q, position, capsules, pose = np.arange(12.0), np.ones(3), (CANE,), pin.SE3.Random()
    assert frame.configuration_in_map(q) is q and frame.configuration_in_odom(q) is q
    assert frame.capsules_in_odom(capsules) is capsules and frame.position_in_odom(position) is position
    assert frame.pose_in_map(pose) is pose and frame.pose_in_odom(pose) is pose


@given(frames, st.lists(st.floats(-3.0, 3.0), min_size=12, max_size=12))
def test_there_and_back_is_the_same_place(frame, values):
    q = np.array(values)
    moved = frame.configuration_in_map(q)
    np.testing.assert_allclose(frame.configuration_in_odom(moved), q, atol=1e-9)
    np.testing.assert_array_equal(moved[3:], q[3:])
    base = pin.SE3(pin.exp3(q[2] * UP), np.array([q[0], q[1], 0.0]))
    np.testing.assert_allclose(frame.pose_in_map(base).translation[:2], moved[:2], atol=1e-9)
    np.testing.assert_allclose(frame.pose_in_map(base).rotation, pin.exp3(moved[2] * UP), atol=1e-9)
    np.testing.assert_allclose(frame.pose_in_odom(frame.pose_in_map(base)).homogeneous, base.homogeneous, atol=1e-9)


@given(frames)
def test_a_capsule_moves_with_its_ends_and_stays_what_it_is(frame):
    (moved,) = frame.capsules_in_odom((CANE,))
    np.testing.assert_allclose(moved.start, frame.position_in_odom(np.array(CANE.start)), atol=1e-9)
    np.testing.assert_allclose(moved.end, frame.position_in_odom(np.array(CANE.end)), atol=1e-9)
    rest = ("kind", "start_radius", "end_radius", "vine", "spur", "undecided")
    assert [getattr(moved, name) for name in rest] == [getattr(CANE, name) for name in rest]


def test_a_frame_stays_the_same_object_until_another_transform_is_told():
    first = MapFrame().after(told(m.Pose((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    assert first.position_in_odom(np.ones(3)) == pytest.approx([0.0, 1.0, 1.0])
    assert first.after(told(m.Pose((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))) is first
    second = first.after(told(m.Pose((2.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    assert second.position_in_odom(np.ones(3)) == pytest.approx([-1.0, 1.0, 1.0])
    assert second.after(told(m.Pose((3.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.5)))) is second, "its quaternion is none"
