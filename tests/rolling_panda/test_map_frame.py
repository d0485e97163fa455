"""Map and odom: each conversion has its inverse, and without drift changes nothing."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, Localisation
from rolling_panda.model.base_attitude import rotation
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel
from tests.perception.test_frame import good_frame

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


def odometry(x: float, attitude: m.BaseAttitude | None) -> m.Odometry:
    return m.Odometry(
        header=m.Header(1.0, "odom"), sequence=1, pose=m.PlanarPose(x, 0.0, 0.3), linear=0.0, angular=0.0,
        attitude=attitude,
    )  # fmt: skip


angles = st.floats(-0.1, 0.1)


@given(frames, angles, angles, st.floats(-0.05, 0.05))
def test_on_uneven_ground_there_and_back_is_the_same_place_and_the_base_is_where_it_was(frame, roll, pitch, height):
    attitude = m.BaseAttitude(height, roll, pitch)
    stood = frame.standing(odometry(2.0, attitude))
    place = np.array([2.3, 0.8, 0.9])
    np.testing.assert_allclose(stood.position_in_odom(stood.position_in_map(place)), place, atol=1e-9)
    q = np.array([2.0, 0.0, 0.3, *np.zeros(9)])
    np.testing.assert_allclose(stood.configuration_in_map(q)[:2], frame.configuration_in_map(q)[:2], atol=1e-9)
    # A place that the base carries is turned with it, about the base.
    base = pin.SE3(pin.exp3(0.3 * UP), np.array([2.0, 0.0, 0.0]))
    carried = base * pin.SE3(rotation(attitude), np.array([0.0, 0.0, height])) * base.inverse()
    np.testing.assert_allclose(stood.position_in_map(place), frame.position_in_map(carried.act(place)), atol=1e-9)


def test_a_picture_is_taken_from_where_the_base_that_carries_the_camera_stood():
    model, frame = RobotModel(), good_frame(base=m.PlanarPose(2.0, 0.0, 0.3))
    attitude = m.BaseAttitude(0.02, 0.05, -0.03)
    on_plane = MapFrame(pin.SE3(pin.exp3(0.2 * UP), np.array([1.0, 0.0, 0.0])))
    level, tilted = on_plane.camera(frame, model), on_plane.camera(replace(frame, attitude=attitude), model)
    now = on_plane.standing(odometry(9.0, m.BaseAttitude(0.0, 0.1, 0.0)))
    np.testing.assert_allclose(now.camera(frame, model).homogeneous, level.homogeneous, atol=1e-12)
    base = pin.SE3(pin.exp3(0.3 * UP), np.array([2.0, 0.0, 0.0]))
    on_base = base.actInv(on_plane.T_map_odom.actInv(level))
    expected = on_plane.T_map_odom * base * pin.SE3(rotation(attitude), np.array([0.0, 0.0, 0.02])) * on_base
    np.testing.assert_allclose(tilted.homogeneous, expected.homogeneous, atol=1e-9)


def test_a_base_that_stands_as_before_leaves_the_frame_as_it_is():
    level = MapFrame()
    assert level.standing(odometry(1.0, None)) is level
    stood = level.standing(odometry(1.0, m.BaseAttitude(0.0, 0.02, 0.0)))
    assert stood is not level and stood.T_map_odom is None
    assert stood.standing(odometry(1.0, m.BaseAttitude(0.0, 0.0201, 0.0))) is stood
    assert stood.standing(odometry(1.0, m.BaseAttitude(0.0, 0.022, 0.0))) is not stood
    assert stood.standing(odometry(1.0, None)).T_odom_level is None
    told_elsewhere = stood.after(told(m.Pose((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    assert told_elsewhere.T_odom_level is stood.T_odom_level, "what is told of the map says nothing of the ground"
