"""When a preview may be followed: what an approval holds for, and each way in which it expires."""

import math
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from controller.core import Controller
from controller.ledger.journal import PreviewRequiredRow
from controller.planning import preview as preview_module
from controller.planning.cuts import CutPlanner
from controller.planning.preview_plan import PreviewRequest
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import ARM_Q
from rolling_panda.model.wire_values import arm_torques
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, run_until
from tests.support.points import point
from tests.support.previewed import ROLLOUT, Previewed

PLACES = (0.45, 0.75, 1.05), (0.75, 0.75, 1.1)
POINTS = point("a", PLACES[0]), point("b", PLACES[1])

TOO_NEAR = reasons.obstacle_in_way("wire", "blades", "b", 7.0)


@pytest.fixture(autouse=True)
def no_planner(monkeypatch):
    monkeypatch.setattr(preview_module, "_PLAN_S", 0.0)


@pytest.fixture(scope="module")
def rolled():
    """Previews that were made once are not made again."""
    made = {}

    def roll(request):
        key = tuple(each.point_id for each in request.points), request.obstacles, request.q.round(6).tobytes()
        before = made.get(key) or ROLLOUT.roll(request)
        made[key] = before
        return replace(before, request=request)

    return roll


@pytest.fixture
def p(rolled):
    return Previewed(POINTS, roll=rolled)


def required(p):
    assert p.ask(intents.RequirePreview, required=True) == ""
    return p


def test_who_wants_no_previews_starts_without(p):
    assert p.ask(intents.AcceptPoint, point_id="a", revision=1) == ""
    assert p.ask(intents.Start) == ""


def test_with_previews_required_nothing_starts_before_one_is_approved(p):
    required(p)
    assert p.ask(intents.AcceptAll) == ""
    assert "ask for one and approve it" in p.ask(intents.Start)
    assert p.robot.state.allowed["Start"] is not None and p.robot.state.allowed["Survey"] is None
    shown = p.again()
    assert "approve it first" in p.ask(intents.Start)
    assert "another one now" in p.ask(intents.ApprovePreview, preview_hash="0" * 64)
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    assert (p.state.phase, p.state.approved_by) == ("approved", "ada")
    assert p.robot.state.allowed["Start"] is None


def test_a_preview_of_one_cut_allows_that_one_alone(p):
    required(p)
    p.ask(intents.AcceptAll)
    shown = p.again("a")
    assert [cut.point_id for cut in shown.cuts] == ["a"] and shown.remaining == 1
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    p.worked()
    assert [name for name, _ in p.robot.cuts] == ["a"]
    p.robot.run(0.2)
    assert p.robot.state.mode == "READY" and p.robot.state.reason == reasons.not_in_preview("b")
    assert p.state.phase == "expired"
    assert "expired" in p.ask(intents.Start)
    assert [name for name, _ in p.robot.cuts] == ["a"]


def test_what_comes_later_is_not_approved_before_what_comes_first(p):
    p.ask(intents.AcceptAll)
    shown = p.again("b")
    assert "a comes before b" in p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash)
    assert p.ask(intents.MoveInQueue, point_id="b", before="a", revision=0) == ""
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""


def test_what_the_preview_does_not_cut_is_not_cut_under_its_approval(rolled):
    def not_b(request):
        made = rolled(request)
        cuts = tuple(
            cut if cut.point_id == "a" else structs.replace(cut, cut_s=None, reason=TOO_NEAR) for cut in made.cuts
        )
        return replace(made, cuts=cuts)

    p = required(Previewed(POINTS, roll=not_b))
    shown = p.previewed()
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    p.worked()
    assert [name for name, _ in p.robot.cuts] == ["a"]
    assert p.robot.state.reason == reasons.not_cut_in_preview("b", TOO_NEAR)


def test_a_base_that_was_moved_ends_the_approval_and_is_told(p):
    required(p)
    shown = p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    p.robot.q[0] += 0.31
    p.robot.run(0.3)
    assert p.state.phase == "expired" and p.state.reason.code == "robot_elsewhere"
    assert "0.31 m" in p.ask(intents.Start)
    assert "0.31 m" in p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash)


def test_a_point_accepted_anew_or_not_any_more_ends_it(p):
    shown = p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    p.robot.show((point("a", (0.452, 0.75, 1.05), revision=2), POINTS[1]))
    p.robot.run(0.2)
    assert p.state.phase == "approved"
    p.ask(intents.ReconsiderPoint, point_id="a")
    assert p.state.phase == "expired" and p.state.reason == reasons.no_longer_accepted("a")
    p.ask(intents.AcceptPoint, point_id="a", revision=2)
    assert p.state.phase == "expired"


def test_a_cane_that_is_met_ends_it_as_the_cut_is_made_another_way(rolled):
    canes = tuple(Capsule("cane", (x, 0.75, 0.85), (x, 0.75, z - 0.01), 0.004, 0.004, 1, 1) for x, _, z in PLACES)
    p = required(Previewed(POINTS, roll=rolled, obstacles=canes, external_torque=(0.0,) * 7))
    r, shown = p.robot, p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    assert p.ask(intents.Start) == ""
    while math.dist((tool := r.model.kinematics(r.q)).T_odom_tool.translation, PLACES[0]) > 0.04:
        r.step()
        assert r.now < 20.0
    r.external_torque = arm_torques(tool.J[:3, ARM_Q].T @ np.array([0.0, -28.0, 0.0]))
    r.run(0.3)
    r.external_torque = (0.0,) * 7
    run_until(r, lambda state: state.mode != "AUTO", 30.0)
    assert entry(r, "a").state == "ACCEPTED" and entry(r, "a").reason.code == "cane_met"
    assert r.state.reason == reasons.preview_expired(reasons.approach_turned_after("a"))
    assert p.state.phase == "expired" and r.cuts == []


def post_at(x, y):
    return Capsule("post", (x, y, 0.0), (x, y, 2.0), 0.04, 0.04)


def test_what_comes_into_the_way_ends_it_and_what_leaves_it_room_does_not(p):
    shown = p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    beside = (post_at(8.0, 0.75), post_at(0.9, 0.75), Capsule("wire", (-2, 0.75, 1.75), (2, 0.75, 1.75), 0.004, 0.004))
    p.robot.obstacles = beside
    p.robot.run(0.3)
    assert p.state.phase == "approved"
    halfway = p.motion.rows[len(p.motion.rows) // 3].tool
    p.robot.obstacles = (*beside, post_at(*halfway[:2]))
    p.robot.run(0.3)
    assert p.state.phase == "expired" and ("point", "a") in p.state.reason.values


@pytest.mark.long
def test_what_is_planned_or_accepted_meanwhile_leaves_the_order_that_was_shown(p):
    p.robot.show((*POINTS, point("c", (0.1, 0.75, 1.0))))
    shown = p.previewed("a", "b")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    p.robot.run(0.5)
    plan = CutPlanner(CONFIG, RobotConfig()).plan(p.request)
    p.plan = replace(plan, cuts=tuple(sorted(plan.cuts, key=lambda cut: cut.point.point_id, reverse=True)))
    p.robot.run(0.2)
    assert p.session_plan.state == "valid"
    assert p.ask(intents.AcceptPoint, point_id="c", revision=1) == ""
    p.worked()
    assert [name for name, _ in p.robot.cuts][:2] == ["a", "b"]


def test_another_order_ends_it(p):
    shown = p.previewed()
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    assert p.ask(intents.MoveInQueue, point_id="b", before="a", revision=0) == ""
    assert p.state.phase == "expired" and p.state.reason == reasons.another_comes_first("b", "a")


def test_an_approval_that_expires_under_way_keeps_the_blades_from_closing(p):
    required(p)
    shown = p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    assert p.ask(intents.Start) == ""
    p.robot.run(1.5)
    assert p.robot.state.active_point_id == "a"
    x, y, _ = next(row.tool for row in p.motion.rows if row.time > shown.cuts[0].cut_s)
    p.robot.obstacles = (post_at(x, y),)
    p.robot.run(10.0)
    assert p.robot.cuts == []
    assert entry(p.robot, "a").state == "ACCEPTED"
    assert any("a was left: The preview has expired: A post is seen" in text for text in p.robot.events)


def test_there_is_nothing_to_preview_without_an_accepted_point(p):
    assert p.ask(intents.RequestPreview) == text_of(reasons.none_accepted())
    assert p.ask(intents.RequestPreview, point_id="a") == text_of(reasons.none_accepted())
    assert p.ask(intents.ApprovePreview, preview_hash="") == text_of(reasons.preview_missing())
    assert p.ask(intents.AcceptPoint, point_id="b", revision=1) == ""
    assert p.ask(intents.RequestPreview, point_id="a") == text_of(reasons.point_to_accept("a", "PROPOSED"))


def test_what_was_required_is_required_after_a_restart(rolled):
    controller = Controller(CONFIG, RobotConfig())
    controller.restore((), preview=PreviewRequiredRow(required=True))
    p = Previewed(POINTS, controller, roll=rolled)
    p.ask(intents.AcceptAll)
    assert p.state.required
    assert "preview" in p.ask(intents.Start)


def test_a_preview_that_failed_says_why():
    def fail(request: PreviewRequest):
        return preview_module.Preview(request, failure=reasons.planner_ended())

    p = Previewed(POINTS, roll=fail)
    p.ask(intents.AcceptAll)
    p.ask(intents.RequestPreview)
    p.robot.run(0.3)
    assert p.state.phase == "none" and p.state.reason == reasons.preview_failed(reasons.planner_ended())
