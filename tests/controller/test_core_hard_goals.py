"""Goals and starts that cannot simply be driven to: the running controller stays in bounds, says why, and recovers."""

import numpy as np
import pinocchio as pin
import pytest

from controller.motion.surroundings import obstacles_of
from controller.whole_body.collision import CollisionModel
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from rolling_panda.model.robot import ARM_Q, RobotModel, pose_message
from rolling_panda.reasons import text_of
from tests.controller.test_core_work import (
    CONFIG,
    LIMITS,
    assert_limits_kept,
    entry,
    finish,
    point,
    robot,
    working,
)

MODEL = RobotModel()
COLLISION = CollisionModel(MODEL)


def armed(**changes):
    r = robot(**changes)
    r.run(0.05)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.05)
    return r


def lead(r, target, seconds):
    """Hold the tool to a pose for some time; the least distance between the robot's parts and to what stands around."""
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", target=pose_message(target))
    COLLISION.set_obstacles(obstacles_of(r.obstacles))
    least = np.inf
    for _ in range(round(10 * seconds)):
        r.run(0.1)
        least = min(least, COLLISION.least(r.q).distance)
    return least


def tool(r):
    return r.model.kinematics(r.q).T_odom_tool.copy()


def at(T, x, y, z):
    return pin.SE3(T.rotation, np.array([x, y, z]))


def missing(r, target):
    return float(np.linalg.norm(tool(r).translation - target.translation))


def recovers(r, start):
    least = lead(r, start, 12.0)
    assert r.state.mode == "TELEOP" and missing(r, start) < 0.01
    assert_limits_kept(r)
    return least


def test_a_goal_out_of_reach_is_approached_as_far_as_the_arm_goes_and_left_again() -> None:
    r = armed()
    start = tool(r)
    high = at(start, *(start.translation + [0.0, 0.0, 1.5]))
    assert lead(r, high, 6.0) > 0.0
    assert r.state.mode == "TELEOP" and missing(r, high) > 0.3
    assert np.hypot(*r.q[:2]) < 2.0
    assert recovers(r, start) > 0.0


@pytest.mark.long
def test_a_goal_through_the_axle_neither_folds_the_arm_into_the_base_nor_runs_away() -> None:
    r = armed()
    start = tool(r)
    # From beside the robot straight through its middle to the other side.
    for y in (0.3, 0.0, -0.3, -0.6):
        assert lead(r, at(start, float(start.translation[0]) - 0.5, y, 1.0), 2.0) > 0.0
    assert np.hypot(*r.q[:2]) < 3.0
    assert recovers(r, start) > 0.0


@pytest.mark.long
def test_a_goal_behind_the_base_is_reached_by_driving_back() -> None:
    r = armed()
    start = tool(r)
    behind = at(start, -1.2, float(start.translation[1]), float(start.translation[2]))
    assert lead(r, behind, 12.0) > 0.0
    assert missing(r, behind) < 0.01 and r.q[0] < -1.0 and abs(r.q[2]) < 0.1
    assert recovers(r, start) > 0.0


@pytest.mark.long
def test_a_post_in_between_is_not_met_and_the_tool_comes_back() -> None:
    r = armed()
    start = tool(r)
    x, y, z = start.translation
    r.obstacles = (Capsule("post", (x + 0.3, y, 0.0), (x + 0.3, y, 2.0), 0.05, 0.05),)
    r.run(0.1)
    beyond = at(start, x + 0.6, y, z)
    assert lead(r, beyond, 5.0) >= CONFIG.whole_body.hierarchy.blade_distance - 1e-4
    assert missing(r, beyond) > 0.1 and np.abs(r.record[-1]).max() < 0.01
    assert recovers(r, start) > 0.0


@pytest.mark.long
def test_work_behind_a_post_ends_with_a_reason_and_the_rest_is_done() -> None:
    # The post stands beside the robot's path, where the tool passes between cuts.
    r = working((point("here", (0.2, 0.75, 1.05)), point("beyond", (1.5, 0.75, 1.05))))
    r.obstacles = (Capsule("post", (0.85, 0.52, 0.0), (0.85, 0.52, 2.0), 0.05, 0.05),)
    finish(r, 90.0)
    COLLISION.set_obstacles(obstacles_of(r.obstacles))
    assert COLLISION.least(r.q).distance > 0.0
    assert entry(r, "here").state == "DONE"
    beyond = entry(r, "beyond")
    assert beyond.state == "FAILED_NOT_CUT" and "post 0" in text_of(beyond.reason)
    assert r.state.mode == "READY"
    assert r.ask(intents.Home(user="ada")).ok
    r.run(12.0)
    assert text_of(reasons.homing_blocked("blades – post 0")) == r.events[-1]
    # With the base driven away from the post by hand, the way home is free.
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(-0.2, 0.0))
    r.run(2.0)
    r.teleop = None
    r.run(0.5)
    assert r.ask(intents.Home(user="ada")).ok
    r.run(12.0)
    np.testing.assert_allclose(r.q[ARM_Q], CONFIG.work.home, atol=0.02)


def test_a_start_outside_a_joint_limit_comes_back_inside_and_is_never_sent_further_out() -> None:
    r = robot()
    r.q[8] = LIMITS.upper[8] + 0.08
    r.run(0.05)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.05)
    goal = at(tool(r), *(tool(r).translation + [0.05, 0.0, 0.05]))
    begun = len(r.record)
    lead(r, goal, 6.0)
    outwards = np.array(r.record)[begun:, 5]
    assert outwards[:30].max() <= 1e-9 and LIMITS.lower[8] < r.q[8] < LIMITS.upper[8]
    assert missing(r, goal) < 0.02
