"""The small tasks of the null space, one by one."""

import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.task import IkProblem, Posture, ToolTask
from controller.whole_body.tasks.arm_posture import ArmPosture
from controller.whole_body.tasks.joint_centre import JointCentre
from controller.whole_body.tasks.manipulability import ClimbManipulability
from controller.whole_body.tasks.smoothness import Smoothness
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

ROBOT, CONFIG = RobotModel(), ControllerConfig()
SPEED = np.array([0.3, 0.2, *[2.0] * 7])


def demand(arm=CONFIG.work.home, sent=None, posture=None):
    q = np.zeros(12)
    q[ARM_Q] = arm
    sent = np.zeros(9) if sent is None else sent
    return IkProblem(q, ROBOT.kinematics(q), sent, ToolTask(np.zeros(6)), posture or Posture(q))


def written(task, problem):
    J, t = np.zeros((task.rows, 9)), np.zeros(task.rows)
    task.prepare(J)
    task.write(problem, J, t)
    return J, t


def best(task, problem):
    """The velocity ν that serves the task alone."""
    J, t = written(task, problem)
    return np.linalg.pinv(J) @ t


def test_the_arm_goes_to_its_posture_and_with_it():
    problem = demand()
    q, rate = problem.q.copy(), np.zeros(12)
    q[6] += 0.2
    rate[8] = 0.1
    got = best(ArmPosture(2.0, 1.5, SPEED), demand(posture=Posture(q, rate)))
    np.testing.assert_allclose(got, [0, 0, 0, 0.3, 0, 0.1, 0, 0, 0], atol=1e-12)


def test_smoothness_asks_for_the_last_velocity_in_terms_of_v_and_omega():
    sent = np.arange(9) * 0.1
    got = best(Smoothness(0.2, Actuation(ROBOT.drive), SPEED), demand(sent=sent))
    assert tuple(got[:2]) == pytest.approx(ROBOT.drive.twist(0.0, 0.1))
    np.testing.assert_allclose(got[2:], sent[2:])


def test_a_joint_is_sent_back_only_near_its_limit_and_the_more_the_nearer():
    task = JointCentre(10.0, 2.0, 0.25, ROBOT.limits, SPEED)
    arm = np.array(CONFIG.work.home)
    assert not written(task, demand(arm))[0].any()
    pushes = []
    for distance in (0.2, 0.1, 0.0):
        arm[3] = ROBOT.limits.upper[8] - distance
        J, t = written(task, demand(arm))
        assert np.count_nonzero(J) == 1
        pushes.append(float((J.T @ t)[5]))
    assert 0 > pushes[0] > pushes[1] > pushes[2]


def test_a_clumsy_arm_climbs_to_more_manipulability_and_a_dexterous_one_rests():
    climb = ClimbManipulability(1.0, 0.2, 0.08)
    arm = np.array([0.0, 0.3, 0.0, -0.6, 0.0, 1.2, 0.0])
    problem = demand(arm)
    climb.now = ArmManipulability().at(problem.kinematics.J)
    assert climb.now.value < 0.08
    step = best(climb, problem)[ARM_XI]
    after = ArmManipulability().at(demand(arm + 0.01 * step / np.linalg.norm(step)).kinematics.J)
    assert after.value > climb.now.value
    climb.now = ArmManipulability().at(demand().kinematics.J)
    assert climb.now.value > 0.08
    assert not written(climb, demand())[0].any()
