import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.control.goal_planner import GoalPlanner
from benchmarks.control.path import Planned, Refused
from benchmarks.control.plan_limits import plan_limits
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

ROBOT = RobotModel()
COLLISION = CollisionModel(ROBOT)
LIMITS = plan_limits(ROBOT, base_speed=0.8, base_yaw_rate=0.6)
PLANNER = GoalPlanner(ROBOT, COLLISION, LIMITS)
HOME = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])
ANY = st.floats(0.05, 0.95)


@pytest.fixture
def obstacles():
    yield COLLISION.set_obstacles
    COLLISION.set_obstacles([])


def start(arm=HOME, base=(0.0, 0.0, 0.0)):
    q = np.zeros(12)
    q[:3], q[ARM_Q] = base, arm
    return q


def pose(x, y, z, yaw=0.0, tilt=0.0, roll=0.0):
    R = pin.rpy.rpyToMatrix(0, 0, yaw) @ pin.rpy.rpyToMatrix(0, np.pi / 2 + tilt, 0) @ pin.rpy.rpyToMatrix(0, 0, roll)
    return pin.SE3(R, np.array([x, y, z]))


def check(planned, q, goal, free=False):
    """The plan starts at q, ends at the goal, obeys the wheels exactly, and stays within every limit."""
    assert isinstance(planned, Planned), planned
    plan, dt = planned.plan, LIMITS.dt
    np.testing.assert_allclose(np.diff(plan.t), dt, atol=1e-12)
    np.testing.assert_array_equal(plan.q[0], q)
    assert not plan.xi[-1].any()
    for row in range(len(plan.t) - 1):
        base = ROBOT.drive.integrate(plan.q[row, :3], plan.xi[row, 0] * dt, plan.xi[row, 1] * dt)
        np.testing.assert_allclose(plan.q[row + 1, :3], base, atol=1e-9)
        assert (
            np.abs(ROBOT.drive.constraint(plan.q[row, 2]) @ ROBOT.drive.basis(plan.q[row, 2]) @ plan.xi[row]).max()
            < 1e-9
        )
    np.testing.assert_allclose(plan.q[1:, 3:], plan.q[:-1, 3:] + plan.xi[:-1] * dt, atol=1e-9)
    limits = ROBOT.limits
    still = np.zeros((1, 9))
    assert (np.abs(plan.xi) <= limits.velocity).all()
    acceleration = np.diff(np.vstack([still, plan.xi]), axis=0) / dt
    assert (np.abs(acceleration) <= limits.acceleration).all()
    jerk = np.diff(np.vstack([still, acceleration, still]), axis=0) / dt
    assert (np.abs(jerk[:, ARM_XI]) <= ROBOT.limits.jerk[ARM_XI]).all()
    tool = ROBOT.pose(plan.q[-1], ROBOT.tool_id)
    np.testing.assert_allclose(plan.T_odom_tool[-1], tool.homogeneous, atol=1e-9)
    assert np.linalg.norm(tool.translation - goal.translation) < 1e-6
    axes = slice(1, 2) if free else slice(0, 3)
    np.testing.assert_allclose(tool.rotation[:, axes], goal.rotation[:, axes], atol=1e-6)
    assert plan.duration < 30.0
    return plan


def least(plan):
    return min(COLLISION.least(q).distance for q in plan.q)


@settings(max_examples=15, deadline=None)
@given(
    st.floats(-4, 4),
    st.floats(-4, 4),
    st.floats(0.4, 1.2),
    *[st.floats(-3.2, 3.2)] * 2,
    st.booleans(),
    st.tuples(*[ANY] * 7),
)
def test_plans_from_anywhere_to_anywhere_are_within_every_limit(x, y, z, yaw, roll, free, share):
    arm = LIMITS.lower + np.array(share) * (LIMITS.upper - LIMITS.lower)
    q, goal = start(arm), pose(x, y, z, yaw, 0.2, roll)
    if COLLISION.least(q).distance < LIMITS.clearance:
        return  # Starts in contact have a test of their own.
    planned = PLANNER.plan(q, goal, free)
    plan = check(planned, q, goal, free)
    assert (plan.q[:, ARM_Q] >= LIMITS.lower - 1e-9).all() and (plan.q[:, ARM_Q] <= LIMITS.upper + 1e-9).all()
    assert least(plan) >= LIMITS.clearance - 0.015
    assert planned.clearance.distance == pytest.approx(least(plan), abs=0.006)


def test_the_same_question_has_the_same_answer_and_another_a_different_digest():
    a, b = (PLANNER.plan(start(), pose(2.0, 1.0, 0.9)).plan for _ in range(2))
    assert a.digest == b.digest and len(a.digest) == 64
    assert PLANNER.plan(start(), pose(2.0, 1.0, 0.91)).plan.digest != a.digest


def test_base_and_arm_move_at_once_unless_told_not_to():
    goal = pose(3.0, 1.0, 0.9)

    def both(plan):
        return int((plan.xi[:, :2].any(axis=1) & plan.xi[:, ARM_XI].any(axis=1)).sum())

    together = check(PLANNER.plan(start(), goal), start(), goal)
    decoupled = check(PLANNER.plan(start(), goal, together=False), start(), goal)
    assert both(together) > 50 and both(decoupled) == 0
    assert decoupled.duration > together.duration + 0.5


def test_the_arm_waits_in_the_better_posture_while_the_base_drives():
    goal = pose(4.0, 0.0, 0.9)
    good, poor = start(), start((0.0, 0.9, 0.0, -0.5, 0.0, 1.4, 0.8))
    late, early = check(PLANNER.plan(good, goal), good, goal), check(PLANNER.plan(poor, goal), poor, goal)
    assert not late.xi[: len(late.t) // 3, ARM_XI].any() and late.xi[-50:, ARM_XI].any()
    assert early.xi[:10, ARM_XI].any() and not early.xi[-50:, ARM_XI].any()


@pytest.mark.parametrize("goal", [pose(-0.9, 0.0, 0.9, yaw=np.pi), pose(-0.3, 0.0, 0.5), pose(0.0, 0.0, 0.6, tilt=0.6)])
def test_goals_behind_close_to_and_over_the_base_are_reached(goal):
    plan = check(PLANNER.plan(start(), goal), start(), goal)
    assert least(plan) > LIMITS.clearance - 0.015


def test_a_start_outside_a_joint_limit_comes_back_in_and_reaches():
    arm = HOME.copy()
    arm[5] = ROBOT.limits.upper[5] + 0.15
    plan = check(PLANNER.plan(start(arm), pose(1.5, 0.5, 0.9)), start(arm), pose(1.5, 0.5, 0.9))
    outside = plan.q[:, 10] > ROBOT.limits.upper[5]
    assert outside[0] and not outside[-1]
    assert (np.diff(plan.q[outside, 10]) <= 0.0).all()


def test_a_start_in_contact_gets_away_and_reaches():
    # Half-way into the base, up to where the arm touches it.
    deep = np.array([0.0, 1.2, 0.0, -2.6, 0.0, 2.6, 0.8])
    touching = (start(HOME + share * (deep - HOME)) for share in np.linspace(0.0, 1.0, 200))
    q = next(q for q in touching if COLLISION.least(q).distance < 0.0)
    plan = check(PLANNER.plan(q, pose(1.5, 0.5, 0.9)), q, pose(1.5, 0.5, 0.9))
    assert least(plan) > COLLISION.least(q).distance - 0.001


def test_what_a_start_is_too_near_to_does_not_count_as_the_clearance_of_the_way(obstacles):
    goal = pose(2.0, 1.0, 0.9)
    free = PLANNER.plan(start(), goal)
    blades = ROBOT.pose(start(), ROBOT.tool_id).act(np.array([0.0, 0.0, 0.02]))
    x, y, z = blades.tolist()
    obstacles([Obstacle("cane 1", "cane", (x, y, z - 0.2), (x, y, z + 0.1), 0.004)])
    assert COLLISION.least(start()).distance < 0.014
    planned = PLANNER.plan(start(), goal)
    plan = check(planned, start(), goal)
    assert least(plan) < 0.014, "it begins there"
    assert LIMITS.clearance - 0.006 < planned.clearance.distance <= free.clearance.distance + 0.005


def test_round_a_post_in_between(obstacles):
    goal = pose(3.0, 0.0, 0.9)
    free = PLANNER.plan(start(), goal)
    obstacles([Obstacle("post 1", "post", (1.3, 0.0, 0.0), (1.3, 0.0, 2.0), 0.06)])
    assert least(free.plan) < 0.0
    planned = PLANNER.plan(start(), goal)
    plan = check(planned, start(), goal)
    assert least(plan) > LIMITS.clearance - 0.015
    assert np.abs(plan.q[:, 1]).max() > 0.2


def test_fenced_in_is_refused_in_words_and_works_again_when_the_fence_is_gone(obstacles):
    goal = pose(3.0, 0.0, 0.9)
    posts = [(1.4 * np.cos(a), 1.4 * np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 24, endpoint=False)]
    obstacles([Obstacle(f"post {i}", "post", (x, y, 0.0), (x, y, 2.0), 0.05) for i, (x, y) in enumerate(posts)])
    refused = PLANNER.plan(start(), goal)
    assert isinstance(refused, Refused)
    assert "comes within" in refused.reason and "post" in refused.reason
    obstacles([])
    check(PLANNER.plan(start(), goal), start(), goal)


def test_a_goal_out_of_reach_or_not_finite_is_refused_in_words():
    assert "is out of reach" in PLANNER.plan(start(), pose(1.0, 0.0, 2.2)).reason
    assert "not finite" in PLANNER.plan(start(), pose(np.nan, 0.0, 1.0)).reason
