import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.config import WorkConfig
from controller.work.posture_search import cut_poses, escape_pose
from rolling_panda.errors import InputError
from rolling_panda.model.map_frame import MapFrame

LEFT = np.array([0.0, 1.0, 0.0])
POINT = np.array([1.0, 0.85, 1.0])
leans, turns = st.floats(0, 0.44), st.floats(0, 6.28)


def cane(lean, turn):
    return np.array([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)])


@given(leans, turns, st.floats(-0.7, 0.7), st.booleans())
def test_blades_are_square_to_the_cane_and_come_from_the_robots_side(lean, turn, azimuth, upside):
    tangent = cane(lean, turn) * (1 if upside else -1)
    poses = cut_poses(POINT, tangent, LEFT, 0.15, 0.25, azimuth)
    R = poses.cut.rotation
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert abs(R[:, 1] @ tangent) == pytest.approx(1.0)
    assert R[2, 1] < 0, "the tool's y points down, so that the camera is above the blades"
    assert R[:, 2] @ LEFT > 0.5
    np.testing.assert_allclose(poses.cut.translation, POINT)


@given(leans, turns)
def test_stand_off_and_clearance_are_straight_back(lean, turn):
    poses = cut_poses(POINT, cane(lean, turn), LEFT, 0.15, 0.25, 0.2, 0.2)
    for pose, distance in ((poses.stand_off, 0.15), (poses.clear, 0.25)):
        np.testing.assert_allclose(POINT - pose.translation, distance * poses.cut.rotation[:, 2], atol=1e-9)
        np.testing.assert_allclose(pose.rotation, poses.cut.rotation)


def test_a_tilt_comes_from_below_and_leans_the_cut_by_as_much():
    poses = cut_poses(POINT, np.array([0.0, 0.0, 1.0]), LEFT, 0.15, 0.25, 0.0, 0.2)
    assert poses.stand_off.translation[2] < POINT[2] - 0.02
    assert np.arccos(-poses.cut.rotation[2, 1]) == pytest.approx(0.2)


def test_blades_that_lean_come_on_the_same_line_and_cut_at_the_same_place():
    straight, leaning = (
        cut_poses(POINT, np.array([0.0, 0.0, 1.0]), LEFT, 0.15, 0.25, 0.2, 0.1, lean) for lean in (0.0, 0.3)
    )
    for name in ("clear", "stand_off", "cut"):
        np.testing.assert_allclose(getattr(leaning, name).translation, getattr(straight, name).translation, atol=1e-12)
    np.testing.assert_allclose(leaning.cut.rotation[:, 2], straight.cut.rotation[:, 2])
    turned = straight.cut.rotation.T @ leaning.cut.rotation
    assert np.arccos(turned[1, 1]) == pytest.approx(0.3)


def test_a_cane_that_points_at_the_robot_is_refused():
    with pytest.raises(InputError, match="straight at the robot"):
        cut_poses(POINT, LEFT, LEFT, 0.15, 0.25)


WORK = WorkConfig()
#: How far from the robot's path the tool counts as clear of the canes (m).
DEEPER = 0.03
CLEAR = WORK.row_distance - WORK.clearance + DEEPER
drifts = st.builds(
    lambda x, y, turn, tilt: MapFrame(pin.SE3(pin.rpy.rpyToMatrix(tilt, 0.0, turn), np.array([x, y, 0.01]))),
    st.floats(-2.0, 2.0), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3), st.floats(-0.03, 0.03),
)  # fmt: skip


@given(st.floats(-0.9, 0.9), st.floats(0.01, 0.3), drifts)
def test_escape_leads_out_of_the_row_without_turning_wherever_odom_has_drifted(azimuth, depth, frame):
    among = np.array([1.0, CLEAR + depth, 1.0])
    pose = frame.pose_in_odom(cut_poses(among, np.array([0.0, 0.0, 1.0]), LEFT, 0.15, 0.25, azimuth).cut)
    out = escape_pose(WORK, pose, frame, DEEPER)
    assert frame.pose_in_map(out).translation[1] == pytest.approx(CLEAR)
    np.testing.assert_allclose(out.rotation, pose.rotation, atol=1e-12)


def test_escape_of_a_tool_that_points_elsewhere_is_square_to_the_row():
    pose = cut_poses(np.array([1.0, CLEAR + 0.1, 1.0]), np.array([0.0, 0.0, 1.0]), LEFT, 0.15, 0.25, 0.0).cut
    pose.rotation = pose.rotation @ np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]])
    out = escape_pose(WORK, pose, MapFrame(), DEEPER)
    np.testing.assert_allclose(out.translation, pose.translation - 0.1 * LEFT)


def test_a_tool_that_is_clear_of_the_canes_needs_no_escape():
    pose = cut_poses(np.array([1.0, CLEAR - 0.01, 1.0]), np.array([0.0, 0.0, 1.0]), LEFT, 0.15, 0.25).cut
    assert escape_pose(WORK, pose, MapFrame(), DEEPER) is None
