import numpy as np
import pinocchio as pin
import pytest

from controller.whole_body.manipulability import ArmManipulability
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()


def arm_hessian(robot, q):
    """∂J/∂q of the tool over all of q, (6, 12, 12) as [row, column of J, q], by Pinocchio.

    Its Python binding returns the array with its axes mislabelled; reading the same memory in Fortran order as
    (6, nv, nv) is right, which the tests check against finite differences.
    """
    nv = robot.model.nv
    pin.computeJointJacobians(robot.model, robot.data, q)
    pin.computeJointKinematicHessians(robot.model, robot.data, q)
    raw = pin.getFrameKinematicHessian(robot.model, robot.data, robot.tool_id, pin.LOCAL_WORLD_ALIGNED)
    return np.asarray(raw).ravel().reshape((6, nv, nv), order="F")


def omega(q):
    arm = ROBOT.kinematics(q).J[:, ARM_Q]
    return float(np.sqrt(np.linalg.det(arm @ arm.T)))


def postures(count):
    rng = np.random.default_rng(7)
    lower, upper = ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q]
    for _ in range(count):
        q = np.zeros(12)
        q[:3] = rng.uniform(-2, 2, 3)
        q[ARM_Q] = rng.uniform(lower, upper)
        yield q


def test_gradient_agrees_with_finite_differences():
    manipulability = ArmManipulability()
    for q in postures(20):
        found = manipulability.at(ROBOT.kinematics(q).J)
        numeric = np.zeros(9)
        for i in range(7):
            step = np.zeros(12)
            step[5 + i] = 1e-6
            numeric[2 + i] = (omega(q + step) - omega(q - step)) / 2e-6
        assert found.value == pytest.approx(omega(q), rel=1e-9)
        np.testing.assert_allclose(found.gradient, numeric, atol=1e-7)


def test_moving_along_the_gradient_makes_the_arm_more_dexterous():
    manipulability = ArmManipulability()
    for q in postures(10):
        found = manipulability.at(ROBOT.kinematics(q).J)
        step = np.zeros(12)
        step[ARM_Q] = 1e-4 * found.gradient[2:] / np.linalg.norm(found.gradient[2:])
        assert omega(q + step) > found.value


def test_an_arm_straight_up_counts_as_singular_although_the_whole_robot_is_not():
    # The arm stretched straight up. The paper's text means the arm, its formula prints the whole robot.
    q = np.zeros(12)
    q[ARM_Q] = [1.5, 0.0, 0.6, -0.07, 2.0, 3.3, -1.8]
    k = ROBOT.kinematics(q)
    whole = float(np.sqrt(np.linalg.det(k.J_xi @ k.J_xi.T)))
    assert ArmManipulability().at(k.J).value < 0.01 * whole


def test_pinocchio_hessian_as_reordered_agrees_with_finite_differences():
    for q in postures(3):
        H = arm_hessian(ROBOT, q)
        for i in range(12):
            step = np.zeros(12)
            step[i] = 1e-6
            numeric = (ROBOT.kinematics(q + step).J - ROBOT.kinematics(q - step).J) / 2e-6
            np.testing.assert_allclose(H[:, :, i], numeric, atol=1e-6)
