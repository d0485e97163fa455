import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.control.goal_planner import GoalChooser
from controller.whole_body.manipulability import arm_omega
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.robot import ARM_Q
from tests.benchmarks.test_goal_planner import COLLISION, LIMITS, ROBOT, pose, start

CHOOSER = GoalChooser(ROBOT, COLLISION, LIMITS)
angle = st.floats(-3.2, 3.2)


@settings(max_examples=25, deadline=None)
@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(0.4, 1.2), angle, st.floats(-0.7, 0.6), angle, st.booleans())
def test_every_stand_has_the_tool_at_the_goal_inside_the_limits_and_clear(x, y, z, yaw, tilt, roll, free):
    goal = pose(x, y, z, yaw, tilt, roll)
    found = CHOOSER.find(start(), goal, free)
    assert found.stands and not found.reason
    for stand in found.stands:
        kinematics = ROBOT.kinematics(stand.q)
        tool = kinematics.T_odom_tool
        assert np.abs(tool.translation - goal.translation).max() < 1e-9
        if free:
            assert tool.rotation[:, 1] @ goal.rotation[:, 1] == pytest.approx(1.0, abs=1e-9)
        else:
            assert np.abs(tool.rotation - goal.rotation).max() < 1e-9
        assert (stand.q[ARM_Q] >= LIMITS.lower).all() and (stand.q[ARM_Q] <= LIMITS.upper).all()
        assert stand.omega == pytest.approx(arm_omega(kinematics.J), abs=1e-6)
        assert stand.clearance == COLLISION.least(stand.q).distance >= LIMITS.clearance


def test_the_same_seed_gives_the_same_stands():
    again = GoalChooser(ROBOT, COLLISION, LIMITS, seed=0).find(start(), pose(2.0, 1.0, 0.9))
    for a, b in zip(again.stands, CHOOSER.find(start(), pose(2.0, 1.0, 0.9)).stands, strict=True):
        np.testing.assert_array_equal(a.q, b.q)


def test_a_near_goal_needs_no_driving():
    best = CHOOSER.find(start(), pose(0.6, 0.0, 0.9)).stands[0]
    assert np.hypot(*best.q[:2]) < 0.3 and best.time < 3.0


def test_with_a_fixed_base_only_the_arm_moves():
    q = start(base=(1.0, 2.0, 0.5))
    q[3:5] = 1.0, 2.0
    found = CHOOSER.find(q, pose(1.5, 2.3, 0.9, yaw=0.5), base_fixed=True)
    assert found.stands
    for stand in found.stands:
        np.testing.assert_array_equal(stand.q[:5], q[:5])
    far = CHOOSER.find(start(), pose(3.0, 0.0, 0.9), base_fixed=True)
    assert not far.stands and "out of reach" in far.reason


def test_a_goal_too_high_is_refused_with_the_numbers():
    found = CHOOSER.find(start(), pose(1.0, 0.0, 2.5))
    assert not found.stands
    assert found.reason.startswith("the goal (1.00, 0.00, 2.50) m is out of reach") and "0.72 m long" in found.reason


def test_a_goal_under_the_ground_is_refused():
    found = CHOOSER.find(start(), pose(1.0, 0.0, 0.0, tilt=0.6))
    assert not found.stands and "postures reach it" in found.reason and "ground" in found.reason


def test_a_goal_inside_a_post_is_refused_with_its_name_and_can_be_reached_without_it():
    COLLISION.set_obstacles([Obstacle("post 3", "post", (2.0, 0.0, 0.0), (2.0, 0.0, 2.0), 0.05)])
    try:
        found = CHOOSER.find(start(), pose(2.0, 0.0, 0.9))
        assert not found.stands and "post 3" in found.reason
    finally:
        COLLISION.set_obstacles([])
    assert CHOOSER.find(start(), pose(2.0, 0.0, 0.9)).stands
