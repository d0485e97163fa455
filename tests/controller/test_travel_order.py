"""The order of the cuts: of little cost, where the cost is the time of the motions that are driven."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.motion.tool_motion import ToolMotion
from controller.planning.cuts import leaving_times, length, shortest, travel_times
from controller.work.cutting import ApproachSegments
from controller.work.posture_search import CutClearance, PostureSearch, completed
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config
from tests.support.points import point

ROBOT, CONFIG, UP = RobotModel(), ControllerConfig(), np.array([0.0, 0.0, 1.0])
START = np.zeros(12)
START[ARM_Q] = CONFIG.work.home
TOOL = ROBOT.pose(START, ROBOT.tool_id).copy()
CLEARANCE = CutClearance(RobotModel(), CONFIG.whole_body.hierarchy)
SEARCH = PostureSearch(RobotModel(), CONFIG.work, CONFIG.whole_body.joint_margin, CLEARANCE)
CUTS = [completed(SEARCH.find(point("p1", (x, 0.75, 1.05)), START)) for x in (0.4, 1.4, 2.4)]


def test_a_motion_takes_as_long_as_the_slowest_of_base_arm_and_tool() -> None:
    times = travel_times(CONFIG, True, (TOOL, START), CUTS)
    assert times.shape == (4, 3)
    np.testing.assert_allclose(np.diag(times[1:]), 0.0, atol=0.05)
    # A metre more of the base, which cruises with a margin for feedback.
    assert times[1, 1] > 1.0 / CONFIG.whole_body.base_speed
    assert times[1, 2] - times[1, 1] == pytest.approx(1.0 / (0.8 * CONFIG.whole_body.base_speed), rel=0.01)
    slow = controller_config(CONFIG, whole_body__base_speed=0.5 * CONFIG.whole_body.base_speed)
    assert travel_times(slow, True, (TOOL, START), CUTS)[1, 1] > 1.5 * times[1, 1]


def test_a_method_that_rests_between_segments_takes_the_sum_of_their_times() -> None:
    drive, reach = ApproachSegments(CONFIG.work, False).there(CUTS[1], TOOL, START)
    first = ToolMotion(CONFIG.motion, CONFIG.whole_body, TOOL, START, [drive], flows=False).duration
    second = ToolMotion(CONFIG.motion, CONFIG.whole_body, drive.goal, drive.q_goal, [reach], flows=False).duration
    assert travel_times(CONFIG, False, (TOOL, START), CUTS)[0, 1] == pytest.approx(first + second)


def test_no_cuts_have_no_order() -> None:
    assert shortest(travel_times(CONFIG, True, (TOOL, START), [])) == []


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_orders_are_complete_and_near_the_best(seed: int, n: int) -> None:
    costs = np.random.default_rng(seed).uniform(1.0, 2.0, (n + 1, n))
    order = shortest(costs)
    assert sorted(order) == list(range(n))
    best = min(length(costs, list(permutation)) for permutation in itertools.permutations(range(n)))
    assert best <= length(costs, order) <= 1.25 * best


def test_on_a_line_the_order_is_the_best_of_all() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        places = np.concatenate([[0.0], rng.uniform(-1.0, 4.0, 7)])
        costs = np.abs(places[:, None] - places[None, 1:])
        best = min(length(costs, list(p)) for p in itertools.permutations(range(7)))
        assert length(costs, shortest(costs)) == pytest.approx(best)


def test_work_ends_ahead_where_the_row_goes_on() -> None:
    """From the middle of three cuts the nearer end comes first; where both are as near, the one behind."""
    start = START.copy()
    start[0] = CUTS[1].q_cut[0]
    tool = ROBOT.pose(start, ROBOT.tool_id).copy()
    costs = travel_times(CONFIG, True, (tool, start), CUTS)
    leaving = leaving_times(CONFIG, start, CUTS)
    np.testing.assert_allclose(leaving, np.array([2.0, 1.0, 0.0]) / CONFIG.whole_body.base_speed, atol=0.5)
    assert shortest(costs, leaving)[-1] == 2
    # Where the row goes on in the other direction, at the other end.
    back = controller_config(CONFIG, work__row_heading=np.pi)
    assert shortest(costs, leaving_times(back, start, CUTS))[-1] == 0
