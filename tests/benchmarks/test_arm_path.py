import numpy as np
import pytest

from benchmarks.control.arm_path import ArmPath, ArmPathPlanner, Blocked
from benchmarks.control.plan_limits import plan_limits
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
LIMITS = plan_limits(ROBOT, base_speed=0.8, base_yaw_rate=0.6)
HOME = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])
LEFT, RIGHT = np.array([1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8]), np.array([-1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8])
POST = Obstacle("post", "post", (0.55, 0.0, 0.0), (0.55, 0.0, 2.0), 0.05)


@pytest.fixture
def collision():
    return CollisionModel(ROBOT)


def configuration(arm):
    q = np.zeros(12)
    q[ARM_Q] = arm
    return q


def least(collision, path, step=0.01):
    """The least clearance along the way, looked at five times as densely as the planner does."""
    out = np.inf
    for a, b in zip(path.postures, path.postures[1:], strict=False):
        for share in np.linspace(0.0, 1.0, int(np.abs(b - a).max() / step) + 2):
            out = min(out, collision.least(configuration(a + share * (b - a))).distance)
    return out


def test_straight_where_nothing_is_in_the_way(collision):
    path = ArmPathPlanner(collision, LIMITS).find(configuration(HOME), LEFT)
    assert isinstance(path, ArmPath)
    np.testing.assert_array_equal(path.postures, [HOME, LEFT])


def test_round_a_post(collision):
    collision.set_obstacles([POST])
    planner = ArmPathPlanner(collision, LIMITS)
    assert least(collision, ArmPath(np.array([LEFT, RIGHT]))) < 0.0
    path = planner.find(configuration(LEFT), RIGHT)
    assert isinstance(path, ArmPath) and len(path.postures) > 2
    np.testing.assert_array_equal(path.postures[[0, -1]], [LEFT, RIGHT])
    assert least(collision, path) > LIMITS.clearance - 0.01
    assert (path.postures >= LIMITS.lower).all() and (path.postures <= LIMITS.upper).all()
    np.testing.assert_array_equal(planner.find(configuration(LEFT), RIGHT).postures, path.postures)


def test_the_search_finds_what_known_postures_do_not(collision, monkeypatch):
    monkeypatch.setattr("benchmarks.control.arm_path._TUCKS", np.empty((0, 6)))
    collision.set_obstacles([POST])
    path = ArmPathPlanner(collision, LIMITS, seed=3).find(configuration(LEFT), RIGHT)
    assert isinstance(path, ArmPath)
    assert least(collision, path) > LIMITS.clearance - 0.01


def test_a_goal_inside_an_obstacle_is_refused_with_the_pair(collision):
    collision.set_obstacles([Obstacle("post 7", "post", (0.5, 0.0, 0.0), (0.5, 0.0, 2.0), 0.05)])
    blocked = ArmPathPlanner(collision, LIMITS).find(
        configuration(LEFT), np.array([0.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8])
    )
    assert isinstance(blocked, Blocked)
    assert blocked.reason.startswith("the arm's goal leaves -") and "post 7" in blocked.reason


def test_a_search_without_an_answer_ends(collision):
    # A fence across the base, in front of, behind and over the arm's shoulder, with the goal on its other side.
    collision.set_obstacles(
        [
            Obstacle(f"{start} {z}", "wire", (start, 0.0, z), (end, 0.0, z), 0.02)
            for start, end, lowest in ((-1.5, -0.3, 0.45), (0.3, 1.5, 0.45), (-0.3, 0.3, 1.0))
            for z in np.arange(lowest, 2.0, 0.1)
        ]
    )
    blocked = ArmPathPlanner(collision, LIMITS).find(configuration(LEFT), RIGHT)
    assert isinstance(blocked, Blocked)
    assert blocked.reason == "no path of the arm keeps 20 mm from every obstacle"


def test_a_start_in_contact_is_left_on_the_short_way(collision):
    # The tool pressed into the base's deck.
    start = np.array([0.0, 1.2, 0.0, -2.6, 0.0, 2.6, 0.8])
    near = collision.least(configuration(start)).distance
    assert near < LIMITS.clearance
    path = ArmPathPlanner(collision, LIMITS).find(configuration(start), HOME)
    assert isinstance(path, ArmPath)
    assert least(collision, path) > near - 0.01
    assert collision.least(configuration(path.postures[1])).distance > LIMITS.clearance


def test_a_start_outside_a_joint_limit_comes_back_in(collision):
    start = HOME.copy()
    start[5] = LIMITS.upper[5] + 0.2
    path = ArmPathPlanner(collision, LIMITS).find(configuration(start), HOME)
    assert isinstance(path, ArmPath)
    outside = (path.postures[1:] > LIMITS.upper) | (path.postures[1:] < LIMITS.lower)
    assert not outside.any()
