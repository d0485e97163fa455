import numpy as np

from controller.motion.follower import Follower, Measured
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.decoupled import Decoupled
from controller.whole_body.saturation import Saturation
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), controller_config(whole_body__method="decoupled"), 0.01
GATE = Saturation(ROBOT, CONFIG.whole_body, DT)


def run(q_goal, seconds):
    """Follow one motion from home; configurations and velocities on the way, and the last tracking."""
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    follower = Follower(CONFIG.motion, Decoupled(ROBOT, CONFIG.whole_body, DT), DT)
    leg = Leg(ROBOT.pose(q_goal, ROBOT.tool_id), q_goal, CONFIG.work.tool_speed)
    motion = ToolMotion(CONFIG.motion, CONFIG.whole_body, ROBOT.pose(q, ROBOT.tool_id), q, [leg])
    sent, record = np.zeros(9), []
    for _ in range(round(seconds / DT)):
        tracking = follower.follow(motion, Measured(q, ROBOT.kinematics(q), sent))
        assert GATE.admits(tracking.xi, sent)
        sent = tracking.xi
        q = q.copy()
        q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
        q[3:] += sent * DT
        record.append((q, sent))
    return record, tracking


def goal(x, y, phi):
    q = np.zeros(12)
    q[:3] = x, y, phi
    q[ARM_Q] = np.array(CONFIG.work.home) + [0.2, 0.1, 0.0, 0.2, 0.0, 0.1, 0.0]
    return q


def test_it_drives_stops_and_only_then_reaches():
    record, tracking = run(goal(0.8, 0.0, 0.0), 15.0)
    driving = np.array([bool(xi[:2].any()) for _, xi in record])
    reaching = np.array([bool(np.abs(xi[2:]).max() > 1e-9) for _, xi in record])
    assert driving.any() and reaching.any()
    assert not (driving & reaching).any()
    assert np.flatnonzero(driving)[-1] < np.flatnonzero(reaching)[0]
    assert tracking.done and tracking.position_error < 1e-3 and tracking.rotation_error < 1e-2


def test_it_turns_drives_and_turns_where_the_goal_is_aside():
    record, tracking = run(goal(-0.5, 0.6, 0.8), 30.0)
    assert tracking.position_error < 1e-3
    np.testing.assert_allclose(record[-1][0][:2], [-0.5, 0.6], atol=0.03)
    assert abs(record[-1][0][2] - 0.8) < 0.03
