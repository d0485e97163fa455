import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ModelError
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel, placement, pose_message

ROBOT = RobotModel()
seeds = st.integers(0, 2**32 - 1)


def posture(seed):
    rng = np.random.default_rng(seed)
    q = np.zeros(12)
    q[:3], q[3:5] = rng.uniform(-3, 3, 3), rng.uniform(-50, 50, 2)
    q[ARM_Q] = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    return q


def test_calibrated_wheels_stand_before_those_of_the_description():
    drive = RobotModel(RobotConfig(wheel_radius=0.1345, track=0.512)).drive
    assert (drive.wheel_radius, drive.half_track) == (0.1345, 0.256)
    assert RobotModel(RobotConfig(track=0.512)).drive.wheel_radius == ROBOT.drive.wheel_radius


def test_coordinates_are_those_of_the_paper():
    names = [name for name in ROBOT.model.names][1:]
    assert names[:5] == ["base_x", "base_y", "base_phi", "wheel_left", "wheel_right"]
    assert names[5:] == [f"panda_joint{i}" for i in range(1, 8)]
    assert ROBOT.drive.wheel_radius == pytest.approx(0.13375)
    assert ROBOT.drive.half_track == pytest.approx(0.2535)


def test_arm_limits_are_the_data_sheets_and_not_half_a_turn():
    lower = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    upper = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
    np.testing.assert_allclose(ROBOT.limits.lower[ARM_Q], lower, atol=1e-4)
    np.testing.assert_allclose(ROBOT.limits.upper[ARM_Q], upper, atol=1e-4)
    np.testing.assert_allclose(ROBOT.limits.velocity[ARM_XI], [2.175] * 4 + [2.61] * 3)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_jacobian_agrees_with_finite_differences(seed):
    q = posture(seed)
    k = ROBOT.kinematics(q)
    step = 1e-6
    for i in range(12):
        plus, minus = q.copy(), q.copy()
        plus[i] += step
        minus[i] -= step
        a, b = ROBOT.pose(minus, ROBOT.tool_id), ROBOT.pose(plus, ROBOT.tool_id)
        column = np.concatenate([b.translation - a.translation, pin.log3(b.rotation @ a.rotation.T)]) / (2 * step)
        np.testing.assert_allclose(k.J[:, i], column, atol=1e-6)


@pytest.mark.parametrize("rho", [0.0, 0.12])
def test_tool_velocity_of_the_actuators_agrees_with_rolling_for_a_moment(rho):
    robot = RobotModel(RobotConfig(rho=rho))
    q = posture(5)
    xi = np.array([1.0, 2.5, 0.1, -0.2, 0.3, 0.2, -0.1, 0.4, 0.3])
    k = robot.kinematics(q)
    dt = 1e-6
    after = q.copy()
    after[:3] = robot.drive.integrate(q[:3], xi[0] * dt, xi[1] * dt)
    after[3:] += xi * dt
    moved = (robot.pose(after, robot.tool_id).translation - k.T_odom_tool.translation) / dt
    np.testing.assert_allclose(k.J_xi[:3] @ xi, moved, atol=1e-5)


def test_pose_survives_the_wire():
    T = ROBOT.pose(posture(1), ROBOT.tool_id)
    back = placement(pose_message(T))
    np.testing.assert_allclose(back.homogeneous, T.homogeneous, atol=1e-9)


def test_a_quaternion_that_is_no_rotation_is_refused():
    with pytest.raises(ModelError, match="length 0.500"):
        placement(m.Pose((0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0)))


def test_unknown_frame_is_refused_with_the_known_ones():
    with pytest.raises(ModelError, match="tool"):
        ROBOT.frame_id("tol")


def test_tool_and_camera_sit_on_the_flange():
    q = np.zeros(12)
    q[ARM_Q] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
    flange, tool = ROBOT.pose(q, ROBOT.flange_id), ROBOT.pose(q, ROBOT.tool_id)
    np.testing.assert_allclose(flange.actInv(tool).translation, [0, 0, 0.18], atol=1e-9)
    camera = tool.actInv(ROBOT.pose(q, ROBOT.camera_id))
    # Above the blades when the tool's y points down, looking along the approach.
    assert camera.translation[1] < -0.05
    assert camera.rotation[2, 2] > 0.95
