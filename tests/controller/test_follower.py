import numpy as np
import pinocchio as pin

from controller.config import ControllerConfig
from controller.motion.follower import ArmMotion, Follower, Measured, tool_error
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.registry import make_method
from controller.whole_body.saturation import Saturation
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
SATURATION = Saturation(ROBOT, CONFIG.whole_body, DT)
FOLLOWER = Follower(CONFIG.motion, make_method(ROBOT, CONFIG.whole_body, DT), DT)


def start():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    return q


def measured(q, sent):
    return Measured(q, ROBOT.kinematics(q), sent)


def integrate(q, xi):
    q = q.copy()
    q[:3] = ROBOT.drive.integrate(q[:3], xi[0] * DT, xi[1] * DT)
    q[3:] += xi * DT
    return q


def test_error_is_the_twist_that_leads_to_the_goal():
    T = ROBOT.pose(start(), ROBOT.tool_id)
    goal = T * pin.exp6(pin.Motion(np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.1])))
    e = tool_error(T, goal)
    np.testing.assert_allclose(T.rotation.T @ e[:3], [0.01, -0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(T.rotation.T @ e[3:], [0.1, 0.2, -0.1], atol=1e-12)


def test_path_is_kept_when_the_limits_slow_the_motion():
    """A motion planned far too fast takes longer, but its line is not left."""
    q, sent = start(), np.zeros(9)
    T = ROBOT.pose(q, ROBOT.tool_id)
    goal = pin.SE3(T.rotation, T.translation + np.array([0.2, 0.15, 0.1]))
    hasty = controller_config(
        motion__tool_acceleration=50.0, motion__tool_jerk=500.0, whole_body__arm_velocity_scale=0.15
    )
    saturation = Saturation(ROBOT, hasty.whole_body, DT)
    follower = Follower(hasty.motion, make_method(ROBOT, hasty.whole_body, DT), DT)
    motion = ToolMotion(hasty.motion, hasty.whole_body, T, q, [Leg(goal, q, 3.0)])
    way = (goal.translation - T.translation) / np.linalg.norm(goal.translation - T.translation)
    steps, off = 0, 0.0
    while steps < 1500:
        tracking = follower.follow(motion, measured(q, sent))
        assert saturation.admits(tracking.xi, sent)
        sent = tracking.xi
        q = integrate(q, sent)
        steps += 1
        off = max(off, np.linalg.norm(np.cross(ROBOT.pose(q, ROBOT.tool_id).translation - T.translation, way)))
        if tracking.done and tracking.position_error < 1e-3:
            break
    assert steps * DT > 2.0 * motion.duration
    assert tracking.position_error < 1e-3
    assert off < 0.005


def test_arm_motion_ends_at_its_goal_with_the_base_still():
    q, sent = start(), np.zeros(9)
    goal = np.array(CONFIG.work.reach)
    motion = ArmMotion(CONFIG.motion, q[ARM_Q].copy(), goal)
    for _ in range(1000):
        sent = motion.step(measured(q, sent), FOLLOWER, DT).xi
        q = integrate(q, sent)
    assert motion.done
    np.testing.assert_allclose(q[ARM_Q], goal, atol=1e-3)
    assert not q[:5].any()


def peak_error_with_a_lag(lag: float, reckoned: float) -> float:
    """Of the tool on 0.3 m (m), every joint following with a first-order lag (s)."""
    config = controller_config(CONFIG, motion__arm_lag_s=reckoned)
    follower = Follower(config.motion, make_method(ROBOT, config.whole_body, DT), DT)
    q, sent, xi, peak = start(), np.zeros(9), np.zeros(9), 0.0
    T = ROBOT.pose(q, ROBOT.tool_id)
    goal = pin.SE3(T.rotation, T.translation + np.array([0.1, -0.2, 0.2]))
    motion = ToolMotion(config.motion, config.whole_body, T, q, [Leg(goal, q, 0.4)])
    while not motion.done:
        kinematics = ROBOT.kinematics(q)
        tracking = follower.follow(motion, Measured(q, kinematics, sent))
        sent = tracking.xi
        peak = max(peak, tracking.position_error)
        for _ in range(10):
            xi = xi + (sent - xi) * (1.0 - np.exp(-DT / 10 / lag))
            q = integrate(q, xi / 10)
    return peak


def test_the_servos_lag_is_reckoned_with():
    assert peak_error_with_a_lag(0.02, 0.02) < 0.1 * peak_error_with_a_lag(0.02, 0.0)
