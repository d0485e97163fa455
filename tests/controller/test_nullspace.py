import numpy as np

from controller.whole_body.nullspace import Nullspace
from controller.whole_body.registry import METHODS, make_method
from controller.whole_body.task import IkProblem, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), controller_config(whole_body__method="nullspace"), 0.01
METHOD = make_method(ROBOT, CONFIG.whole_body, DT)
TWIST = np.array([0.05, 0.02, -0.03, 0.05, -0.1, 0.02])


def problem(twist=TWIST, frozen=False, arm=CONFIG.work.home, sent=None):
    q = np.zeros(12)
    q[2] = 0.3
    q[ARM_Q] = CONFIG.work.home
    reference = q.copy()
    reference[ARM_Q] = arm
    sent = np.zeros(9) if sent is None else sent
    mode = "frozen" if frozen else "row"
    return IkProblem(q, ROBOT.kinematics(q), sent, ToolTask(twist), Posture(reference), mode)


def settled(**changes):
    """The answer after the accelerations have died away."""
    sent = np.zeros(9)
    for _ in range(80):
        out = METHOD.solve(problem(sent=sent, **changes))
        sent = out.xi
    return out


def test_tool_moves_as_asked():
    np.testing.assert_allclose(problem().kinematics.J_xi @ settled().xi, TWIST, atol=2e-4)


def test_a_posture_moves_the_robot_but_not_the_tool():
    still, moved = settled(), settled(arm=np.array(CONFIG.work.home) + [0.5, -0.3, 0.2, 0.5, 0.3, 0.0, -0.3])
    assert np.linalg.norm(moved.xi - still.xi) > 0.1
    np.testing.assert_allclose(problem().kinematics.J_xi @ (moved.xi - still.xi), 0, atol=1e-3)


def test_with_the_base_frozen_only_the_arm_moves():
    out = settled(frozen=True, arm=CONFIG.work.reach)
    assert not out.xi[:2].any()
    np.testing.assert_allclose(problem().kinematics.J_xi @ out.xi, TWIST, atol=1e-3)


def test_along_the_row_the_base_drives_rather_than_turns():
    """The weights are those of forward speed and yaw rate: a sideways tool is not moved by swinging the base."""
    out = settled(twist=np.array([np.cos(0.3), np.sin(0.3), 0, 0, 0, 0]) * 0.1)
    v, omega = ROBOT.drive.twist(out.xi[0], out.xi[1])
    assert v > 0.04
    assert abs(omega) < 0.05


def test_what_is_not_finite_brakes_and_says_so():
    sent = np.full(9, 0.2)
    out = METHOD.solve(problem(twist=np.array([np.nan, 0, 0, 0, 0, 0]), sent=sent))
    assert not out.feasible and "not finite" in out.reason
    assert (np.abs(out.xi) < sent).all() and out.scale == 0.0


def test_what_is_too_fast_is_scaled_and_the_clock_with_it():
    out = settled(twist=40 * TWIST)
    got = problem().kinematics.J_xi @ out.xi
    assert 0.0 < out.scale < 0.9
    np.testing.assert_allclose(got, 40 * TWIST * out.scale, atol=0.01 * np.linalg.norm(got))


def test_methods_are_known_by_name():
    assert isinstance(METHOD, Nullspace)
    assert METHOD.name == "nullspace"
    assert set(METHODS) == {"hierarchy", "nullspace", "decoupled"}
