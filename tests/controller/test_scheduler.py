import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.motion.speed_limits import plan_limits
from controller.planning.base_path import BasePlanner
from controller.planning.path import PathPlanner, Stand
from controller.planning.scheduler import Requirements, Scheduler, Target, length, shortest
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from controller.work.posture_search import PostureSearch
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT, CONFIG, UP = RobotModel(), ControllerConfig(), np.array([0.0, 0.0, 1.0])
COLLISION = CollisionModel(ROBOT)
LIMITS = plan_limits(ROBOT, base_speed=0.3, base_yaw_rate=0.3)
SESSION = Scheduler(PathPlanner(ROBOT, COLLISION, LIMITS), BasePlanner(ROBOT.drive, LIMITS), LIMITS)
HOME = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])


def start():
    q = np.zeros(12)
    q[ARM_Q] = HOME
    return q


def target(name, x, z=1.0, hold=2.0):
    """The tool clear of the canes before a cut on an upright cane."""
    search = PostureSearch(RobotModel(), CONFIG).find(np.array([x, 0.6 + CONFIG.clearance, z]), UP, start())
    try:
        while True:
            next(search)
    except StopIteration as end:
        cut = end.value
    return Target(name, Stand(cut.q_clear, 0.0, cut.joint_margin, cut.manipulability, 0.05), hold)


def test_points_along_the_row_are_worked_through_along_the_row():
    names = ["d", "a", "c", "b"]
    places = {"a": 0.4, "b": 1.4, "c": 2.4, "d": 3.4}
    schedule = SESSION.plan(start(), [target(name, places[name]) for name in names])
    assert [stop.name for stop in schedule.stops] == ["a", "b", "c", "d"]
    assert not schedule.refused
    at = start()
    for stop, after in zip(schedule.stops, [*schedule.stops[1:], None], strict=True):
        np.testing.assert_array_equal(stop.planned.plan.q[0], at)
        at = stop.planned.plan.q[-1]
        tool = ROBOT.pose(at, ROBOT.tool_id).translation
        np.testing.assert_allclose(tool, [places[stop.name], 0.6, 1.0], atol=1e-3)
        assert stop.arrives == pytest.approx(stop.begins + stop.planned.plan.duration)
        assert (after.begins if after else schedule.duration) == pytest.approx(stop.arrives + 2.0)
        assert stop.clearance.distance > 0.0 and stop.omega > 0.012


def test_each_refusal_has_its_own_reason_and_the_others_are_still_done():
    COLLISION.set_obstacles([Obstacle("post 2", "post", (2.0, 0.6, 0.0), (2.0, 0.6, 2.0), 0.05)])
    try:
        singular = replace(target("singular", 1.0), stand=replace(target("", 1.0).stand, omega=0.001))
        schedule = SESSION.plan(start(), [target("in", 2.0), singular, target("good", 0.6)])
    finally:
        COLLISION.set_obstacles([])
    assert [stop.name for stop in schedule.stops] == ["good"]
    assert "post 2" in schedule.refused["in"]
    assert "manipulability there is 0.001" in schedule.refused["singular"]


@pytest.mark.parametrize(
    ("required", "words"),
    [
        (Requirements(clearance=0.5), "500 mm are required"),
        (Requirements(omega=0.5), "at least 0.500 is required"),
        (Requirements(margin=2.0), "2.00 rad are required"),
        (Requirements(duration=0.1), "at most 0 s are allowed"),
    ],
)
def test_what_is_required_is_asked_for_and_said(required, words):
    schedule = SESSION.plan(start(), [target("p", 0.6)], required)
    assert not schedule.stops and words in schedule.refused["p"] and schedule.duration == 0.0


def test_two_targets_of_one_name_are_refused_and_none_is_no_work():
    schedule = SESSION.plan(start(), [target("p", 0.6), target("p", 1.6)])
    assert "two targets have this name" in schedule.refused["p"] and not schedule.stops
    assert SESSION.plan(start(), []).stops == ()


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_orders_are_complete_and_near_the_best(seed, n):
    costs = np.random.default_rng(seed).uniform(1.0, 2.0, (n + 1, n))
    order = shortest(costs)
    assert sorted(order) == list(range(n))
    best = min(length(costs, list(permutation)) for permutation in itertools.permutations(range(n)))
    assert best <= length(costs, order) <= 1.25 * best


def test_on_a_line_the_order_is_the_best_of_all():
    rng = np.random.default_rng(3)
    for _ in range(20):
        places = np.concatenate([[0.0], rng.uniform(-1.0, 4.0, 7)])
        costs = np.abs(places[:, None] - places[None, 1:])
        best = min(length(costs, list(p)) for p in itertools.permutations(range(7)))
        assert length(costs, shortest(costs)) == pytest.approx(best)
