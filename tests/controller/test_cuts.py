"""Plans of whole sessions: what they say is so, what cannot be done is said, and nothing but the request matters."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.planning.cuts import CutPlanner
from controller.planning.work_plan import PlanRequest
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.points import point as pruning_point

CONFIG, ROBOT = ControllerConfig(), RobotModel()
PLANNER = CutPlanner(CONFIG, RobotConfig())
POST = Capsule("post", (0.5, 0.75, 0.0), (0.5, 0.75, 2.0), 0.05, 0.05)


def point(point_id, x, z=1.05, **changes):
    return pruning_point(point_id, (x, 0.75, z), **changes)


def request(*points, obstacles=(), number=1):
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.home
    return PlanRequest(number, q, points, obstacles)


def test_cuts_come_in_the_order_along_the_row_with_what_they_cost() -> None:
    plan = PLANNER.plan(request(point("far", 1.6), point("near", 0.2), point("middle", 0.9)))
    assert [cut.point.point_id for cut in plan.cuts] == ["near", "middle", "far"] and not plan.refused
    at, ended = plan.request.q, 0.0
    for cut in plan.cuts:
        np.testing.assert_array_equal(cut.way.q[0], at)
        at = cut.way.q[-1]
        for part in (slice(0, 3), ARM_Q):
            np.testing.assert_allclose(at[part], cut.cut.q_clear[part], atol=1e-9)
        tool = ROBOT.pose(cut.cut.q_cut, ROBOT.tool_id).translation
        np.testing.assert_allclose(tool, cut.point.position, atol=3e-4)
        assert cut.begins >= ended
        ended = cut.begins + cut.way.duration
        assert cut.clearance >= 0.015 and cut.manipulability >= 0.012 and cut.torque_margin > 0.0
        assert "panda_joint" in cut.torque_joint or "wheel" in cut.torque_joint
    assert plan.duration > ended


@pytest.mark.parametrize(
    ("bad", "obstacles", "words"),
    [
        (point("p", 0.4, z=2.4), (), "no posture of the arm reaches it"),
        (point("p", 0.4, tangent=(0.0, 1.0, 0.0)), (), "points straight at the robot"),
        (point("p", 0.5), (POST,), "between blades and post 0, 7 mm are needed"),
    ],
)
def test_each_refusal_says_why_and_the_others_are_planned(bad, obstacles, words) -> None:
    plan = PLANNER.plan(request(bad, point("good", 1.5), obstacles=obstacles))
    assert [cut.point.point_id for cut in plan.cuts] == ["good"]
    assert list(plan.refused) == ["p"] and words in plan.refused["p"]


def test_a_start_outside_a_joint_limit_is_planned_from() -> None:
    asked = request(point("p", 0.6))
    asked.q[8] = float(ROBOT.limits.upper[8]) + 0.05
    plan = PLANNER.plan(asked)
    assert [cut.point.point_id for cut in plan.cuts] == ["p"]
    assert plan.cuts[0].way.q[0, 8] == asked.q[8] and plan.cuts[0].way.q[-1, 8] < ROBOT.limits.upper[8]


def test_the_same_request_has_the_same_hash_whoever_answers_it() -> None:
    asked = request(point("a", 0.3), point("b", 1.1), obstacles=(POST,))
    first = PLANNER.plan(asked)
    PLANNER.plan(request(point("c", 0.7)))
    again, other = PLANNER.plan(asked), CutPlanner(CONFIG, RobotConfig()).plan(replace(asked, number=7))
    assert first.digest == again.digest == other.digest
    assert [cut.way.digest for cut in first.cuts] == [cut.way.digest for cut in other.cuts]


@pytest.mark.parametrize("what", ["place", "revision", "position", "obstacles", "points", "speed"])
def test_the_hash_changes_when_anything_does(what) -> None:
    asked = request(point("a", 0.3), obstacles=(POST,))
    before = PLANNER.plan(asked).digest
    planner = PLANNER
    if what == "place":
        asked.q[5] += 1e-6
    elif what == "revision":
        asked = replace(asked, points=(point("a", 0.3, revision=2),))
    elif what == "position":
        asked = replace(asked, points=(point("a", 0.3001),))
    elif what == "obstacles":
        asked = replace(asked, obstacles=(msgspec.structs.replace(POST, start_radius=0.051),))
    elif what == "points":
        asked = replace(asked, points=(*asked.points, point("b", 1.2)))
    else:
        planner = CutPlanner(msgspec.structs.replace(CONFIG, base_speed=0.25), RobotConfig())
    assert planner.plan(asked).digest != before


def test_no_points_are_no_work() -> None:
    plan = PLANNER.plan(request())
    assert plan.cuts == () and plan.refused == {} and plan.duration == 0.0 and plan.digest
