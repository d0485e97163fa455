import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.registry import METHODS, make_method
from controller.whole_body.task import Demand, Task
from rolling_panda.errors import ControlError
from rolling_panda.robot_model import ARM_Q, RobotModel

ROBOT, CONFIG = RobotModel(), ControllerConfig()
METHOD = make_method(ROBOT, CONFIG)
TWIST = np.array([0.05, 0.02, -0.03, 0.05, -0.1, 0.02])


def demand(posture, twist=TWIST, frozen=False):
    q = np.zeros(12)
    q[2] = 0.3
    q[ARM_Q] = CONFIG.home
    k = ROBOT.kinematics(q)
    return Demand(q, k, Task("tool", k.J_xi, twist), np.asarray(posture, dtype=float), frozen)


def test_tool_moves_as_asked():
    problem = demand(np.zeros(9))
    np.testing.assert_allclose(problem.tool.jacobian @ METHOD.solve(problem).xi, TWIST, atol=2e-4)


def test_a_posture_moves_the_robot_but_not_the_tool():
    still = METHOD.solve(demand(np.zeros(9)))
    problem = demand([1.0, 1.0, 0.3, -0.2, 0.5, 0, 0.1, 0.2, -0.3])
    moved = METHOD.solve(problem)
    assert np.linalg.norm(moved.xi - still.xi) > 0.1
    np.testing.assert_allclose(problem.tool.jacobian @ (moved.xi - still.xi), 0, atol=1e-3)


def test_with_the_base_frozen_only_the_arm_moves():
    problem = demand([5.0, 5.0, 0, 0, 0, 0, 0, 0, 0], frozen=True)
    out = METHOD.solve(problem)
    assert not out.xi[:2].any()
    np.testing.assert_allclose(problem.tool.jacobian @ out.xi, TWIST, atol=1e-3)


def test_along_the_row_the_base_drives_rather_than_turns():
    """The weights are those of forward speed and yaw rate: a sideways tool is not moved by swinging the base."""
    out = METHOD.solve(demand(np.zeros(9), np.array([np.cos(0.3), np.sin(0.3), 0, 0, 0, 0]) * 0.1))
    v, omega = ROBOT.drive.twist(out.xi[0], out.xi[1])
    assert v > 0.04
    assert abs(omega) < 0.05


def test_what_is_not_finite_is_refused():
    with pytest.raises(ControlError):
        METHOD.solve(_broken())


def _broken():
    problem = demand(np.zeros(9))
    J = problem.tool.jacobian.copy()
    J[0, 0] = np.nan
    return Demand(problem.q, problem.kinematics, Task("tool", J, TWIST), problem.posture, False)


def test_methods_are_known_by_name():
    assert METHODS["nullspace"] is Nullspace
    assert METHOD.name == "nullspace"
