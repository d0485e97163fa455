"""Plans of whole sessions: what they say is so, what cannot be done is said, and nothing but the request matters."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.planning import cuts
from controller.planning.cuts import CutPlanner
from controller.planning.preview_plan import PreviewRequest
from controller.planning.rollout import Rollout
from controller.planning.work_plan import PlanRequest
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import text_of
from tests.support.controller_config import controller_config
from tests.support.points import point as pruning_point

CONFIG, ROBOT = ControllerConfig(), RobotModel()
PLANNER = CutPlanner(CONFIG, RobotConfig())
POST = Capsule("post", (0.5, 0.75, 0.0), (0.5, 0.75, 2.0), 0.05, 0.05)


def point(point_id, x, z=1.05, **changes):
    return pruning_point(point_id, (x, 0.75, z), **changes)


def request(*points, obstacles=(), number=1):
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    return PlanRequest(number, q, points, obstacles)


@pytest.mark.long
def test_cuts_come_in_the_order_along_the_row_as_they_will_be_driven() -> None:
    asked = request(point("far", 1.6), point("near", 0.2), point("middle", 0.9))
    plan = PLANNER.plan(asked)
    assert [cut.point.point_id for cut in plan.cuts] == ["near", "middle", "far"] and not plan.refused
    for cut in plan.cuts:
        tool = ROBOT.pose(cut.cut.q_cut, ROBOT.tool_id).translation
        np.testing.assert_allclose(tool, cut.point.position, atol=3e-4)
        assert cut.rollout.torque_margin > 0.0 and cut.rollout.torque_joint in ROBOT.model.names
    points, postures = tuple(cut.point for cut in plan.cuts), {cut.point.point_id: cut.cut for cut in plan.cuts}
    shown = Rollout(CONFIG, RobotConfig()).roll(PreviewRequest(1, asked.q, points, (), postures))
    assert tuple(cut.rollout for cut in plan.cuts) == shown.cuts, "what a preview of them shows"
    assert plan.duration == shown.duration == plan.cuts[-1].rollout.ends_s
    assert plan.track[0, 0] == 0.0 and plan.track[-1, 0] > 1.0


def test_later_cuts_are_rolled_out_later(monkeypatch) -> None:
    monkeypatch.setattr(cuts, "AHEAD", 2)
    plan = PLANNER.plan(request(point("far", 1.6), point("near", 0.2), point("middle", 0.9)))
    assert [cut.point.point_id for cut in plan.cuts] == ["near", "middle", "far"]
    near, middle, far = (cut.rollout for cut in plan.cuts)
    assert near is not None and far is None
    assert plan.duration == pytest.approx(1.5 * middle.ends_s)


@pytest.mark.long
@pytest.mark.parametrize(("beside", "order"), [(0.02, ["stub", "cut"]), (0.1, ["cut", "stub"])])
def test_a_stub_goes_first_where_the_blades_would_push_a_cane_beside_the_cut_above_it(beside, order) -> None:
    """Such a cane often goes with the stub. The cut comes first on the way along the row."""
    cut, stub = point("cut", 0.5, spur=4), point("stub", 0.54, 1.0, spur=4, kind="renewal cut")
    canes = tuple(((x, 0.75, 0.9), (x, 0.75, 1.2)) for x in (0.5, 0.5 - beside, 0.5 + beside))
    plan = PLANNER.plan(replace(request(cut, stub), canes=canes))
    assert [each.point.point_id for each in plan.cuts] == order
    elsewhere = point("cut", 0.5, spur=5)
    plan = PLANNER.plan(replace(request(elsewhere, stub), canes=canes))
    assert [each.point.point_id for each in plan.cuts] == ["cut", "stub"]


def test_people_set_the_order() -> None:
    points = point("a", 0.2), point("b", 0.6), point("c", 1.0)
    plan = PLANNER.plan(replace(request(*points), order=("c", "a")))
    assert [cut.point.point_id for cut in plan.cuts] == ["c", "a", "b"]


@pytest.mark.long
def test_what_the_rollout_does_not_cut_is_refused_and_the_others_are_rolled_out_without_it() -> None:
    """A bar between the two, at the height of the arm; where the cuts are made there is room."""
    bar = Capsule("wire", (1.2, 0.3, 1.0), (1.2, 0.9, 1.0), 0.004, 0.004)
    points = point("good", 0.3), point("behind", 2.4)
    plan = PLANNER.plan(request(*points, obstacles=(bar,)))
    assert list(plan.refused) == ["behind"] and "wire 0" in text_of(plan.refused["behind"])
    alone = PLANNER.plan(request(points[0], obstacles=(bar,)))
    assert [cut.rollout for cut in plan.cuts] == [cut.rollout for cut in alone.cuts]
    assert plan.duration == alone.duration and plan.digest != alone.digest


@pytest.mark.parametrize(
    ("bad", "obstacles", "words"),
    [
        (point("p", 0.4, z=2.4), (), "No posture of the arm reaches it"),
        (point("p", 0.4, tangent=(0.0, 1.0, 0.0)), (), "points straight at the robot"),
        (point("p", 0.5), (POST,), "between blades and post 0, 7 mm are needed"),
    ],
)
def test_each_refusal_says_why_and_the_others_are_planned(bad, obstacles, words) -> None:
    plan = PLANNER.plan(request(bad, point("good", 1.5), obstacles=obstacles))
    assert [cut.point.point_id for cut in plan.cuts] == ["good"]
    assert list(plan.refused) == ["p"] and words in text_of(plan.refused["p"])


def test_a_start_outside_a_joint_limit_is_planned_from() -> None:
    asked = request(point("p", 0.6))
    asked.q[8] = float(ROBOT.limits.upper[8]) + 0.05
    plan = PLANNER.plan(asked)
    assert [cut.point.point_id for cut in plan.cuts] == ["p"]
    assert plan.cuts[0].rollout.reason is None
    assert plan.cuts[0].rollout.joint_margin < 0.0 < plan.cuts[0].cut.joint_margin


@pytest.mark.long
def test_the_same_request_has_the_same_hash_whoever_answers_it() -> None:
    asked = request(point("a", 0.3), point("b", 1.1), obstacles=(POST,))
    first = PLANNER.plan(asked)
    PLANNER.plan(request(point("c", 0.7)))
    again, other = PLANNER.plan(asked), CutPlanner(CONFIG, RobotConfig()).plan(replace(asked, number=7))
    assert first.digest == again.digest == other.digest
    assert [cut.rollout for cut in first.cuts] == [cut.rollout for cut in other.cuts]


@pytest.mark.long
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
        planner = CutPlanner(controller_config(CONFIG, whole_body__base_speed=0.25), RobotConfig())
    assert planner.plan(asked).digest != before


def test_no_points_are_no_work() -> None:
    plan = PLANNER.plan(request())
    assert plan.cuts == () and plan.refused == {} and plan.duration == 0.0 and plan.digest
