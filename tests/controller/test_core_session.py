"""The running controller and its plan: when it asks, what it does with the answer, and when it does without."""

import numpy as np
import pytest

from controller.planning import cuts, plan_manager
from controller.planning.cuts import CutPlanner
from controller.planning.work_plan import PlanRequest
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import BaseVelocity, SessionPlan, TeleopTarget
from rolling_panda.model.robot import ARM_Q
from rolling_panda.reasons import text_of
from tests.controller.test_core_work import CONFIG, entry, finish, point, robot
from tests.support.sent import every

PLANNER = CutPlanner(CONFIG, RobotConfig())
POST = Capsule("post", (0.5, 0.75, 0.0), (0.5, 0.75, 2.0), 0.05, 0.05)


class Planned:
    """A robot whose plan requests are answered after some periods, as a planner beside it would."""

    def __init__(self, shown, obstacles=(), answer_after=20):
        self.robot, self.after = robot(obstacles=obstacles), answer_after
        self.requests, self.plans = [], []
        self._due = None
        step = self.robot.controller.step

        def with_planner(inbox, now):
            if self._due is not None and len(self.robot.record) >= self._due[0]:
                inbox.put(PLANNER.plan(self._due[1]), now)
                self._due = None
            out = step(inbox, now)
            for request in every(out, PlanRequest):
                self.requests.append(request)
                self._due = len(self.robot.record) + self.after, request
            self.plans += every(out, SessionPlan)
            return out

        self.robot.controller.step = with_planner
        self.robot.step()
        self.robot.show(shown)
        self.robot.step()

    def accepted(self, *point_ids):
        self.robot.step()
        for point_id in point_ids:
            assert self.robot.ask(intents.AcceptPoint(user="ada", point_id=point_id, revision=1)).ok
        return self

    def until_valid(self):
        for _ in range(1000):
            self.robot.step()
            if self.plans and self.plans[-1].state == "valid":
                return self.plans[-1]
        raise AssertionError(f"no valid plan: {self.plans[-1]}")

    def until_valid_again(self, before):
        for _ in range(1000):
            plan = self.until_valid()
            if plan.plan_hash != before.plan_hash:
                return plan
        raise AssertionError("the plan stayed the same")

    def start(self):
        assert self.robot.ask(intents.Arm(user="ada")).ok
        assert self.robot.ask(intents.Start(user="ada")).ok


def order(plan):
    return [each.point_id for each in plan.points if each.order]


def test_accepted_points_are_planned_and_what_the_plan_says_is_told() -> None:
    p = Planned((point("a", (0.3, 0.75, 1.05)), point("high", (0.6, 0.75, 2.4)), point("other", (0.9, 0.75, 1.05))))
    plan = p.accepted("a", "high").until_valid()
    assert len(p.requests) == 1 and len(plan.plan_hash) == 64
    done, refused = plan.points
    assert (done.point_id, done.order, done.reason, done.rollout.reason) == ("a", 1, None, None)
    assert 0.0 == done.rollout.begins_s < 0.5 < done.rollout.cut_s < done.rollout.ends_s == plan.duration_s
    assert (refused.point_id, refused.order, refused.rollout) == (
        "high",
        0,
        None,
    ) and refused.reason.code == "out_of_reach"
    p.robot.run(0.1)
    assert entry(p.robot, "high").state == "UNREACHABLE" and entry(p.robot, "high").reason.code == "out_of_reach"
    assert [e.point_id for e in p.robot.state.queue if e.state == "ACCEPTED"] == ["a"]
    assert entry(p.robot, "high").user == "ada", "who accepted it stays known"


@pytest.mark.long
def test_points_accepted_one_after_the_other_are_planned_once_and_a_late_one_again() -> None:
    p = Planned(tuple(point(name, (x, 0.75, 1.05)) for name, x in (("a", 0.3), ("b", 0.6), ("c", 0.9))))
    p.accepted("a")
    p.robot.run(0.1)
    first = p.accepted("b").until_valid()
    assert [[each.point_id for each in r.points] for r in p.requests] == [["a", "b"]]
    p.accepted("c")
    p.robot.run(0.1)
    assert p.plans[-1].state == "void" and p.plans[-1].reason == reasons.accepted_later("c")
    again = p.until_valid()
    assert len(p.requests) == 2 and order(again) == ["a", "b", "c"]
    assert again.plan_hash != first.plan_hash


@pytest.mark.long
def test_work_follows_the_plan_to_its_stands_and_in_its_order() -> None:
    # The nearest is not the first along the row: from the start it costs less to go forward and come back.
    p = Planned(tuple(point(n, (x, 0.75, 1.05)) for n, x in (("back", -0.5), ("near", 0.2), ("mid", 0.5))))
    plan = p.accepted("back", "near", "mid").until_valid()
    planned = order(plan)
    assert [e.point_id for e in p.robot.state.queue] == planned
    p.start()
    finish(p.robot, 90.0)
    assert [point_id for point_id, _ in p.robot.cuts] == planned
    last = plan.points[-1].base
    assert np.hypot(p.robot.q[0] - last.x, p.robot.q[1] - last.y) < 0.05


@pytest.mark.long
def test_later_cuts_are_rolled_out_during_the_work_and_the_plan_stays_valid(monkeypatch) -> None:
    monkeypatch.setattr(cuts, "AHEAD", 2)
    monkeypatch.setattr(plan_manager, "_NEXT", 2)
    p = Planned(tuple(point(name, (x, 0.75, 1.05)) for name, x in (("a", 0.3), ("b", 0.6), ("c", 0.9))))
    first = p.accepted("a", "b", "c").until_valid()
    assert [each.rollout is None for each in first.points] == [False, False, True]
    p.robot.run(3.0)
    assert len(p.requests) == 1, "at rest the first cuts stay the next ones"
    said = len(p.plans)
    p.start()
    finish(p.robot, 90.0)
    assert [point_id for point_id, _ in p.robot.cuts] == ["a", "b", "c"]
    assert len(p.requests) == 2 and [each.point_id for each in p.requests[1].points] == ["b", "c"]
    assert {plan.state for plan in p.plans[said:]} <= {"valid", "none"}
    assert all(each.rollout.reason is None for each in p.plans[-1].points)


def test_a_point_that_the_plan_refuses_is_not_driven_to_and_the_ticket_says_why() -> None:
    p = Planned((point("in", (0.5, 0.75, 1.05)), point("good", (1.4, 0.75, 1.05))), obstacles=(POST,))
    p.accepted("in", "good").until_valid()
    p.start()
    finish(p.robot, 60.0)
    assert [point_id for point_id, _ in p.robot.cuts] == ["good"]
    assert entry(p.robot, "in").state == "UNREACHABLE", "nothing was tried, so nothing failed"
    assert "post 0" in text_of(entry(p.robot, "in").reason)
    assert p.robot.state.reason == reasons.work_done_but(1)
    assert entry(p.robot, "good").state == "DONE"
    assert p.robot.now < 15.0, "no time is spent on the refused one"


@pytest.mark.long
def test_the_work_does_not_end_before_a_plan_from_the_last_cut_has_refused_what_is_left_too() -> None:
    p = Planned((point("in", (0.5, 0.75, 1.05)), point("good", (1.4, 0.75, 1.05))), obstacles=(POST,))
    p.accepted("in", "good").until_valid()
    p.start()
    p.robot.run(1.0)
    assert entry(p.robot, "in").state == "UNREACHABLE"
    # Seen from nearer, there is no post.
    p.robot.obstacles = ()
    finish(p.robot, 60.0)
    assert [point_id for point_id, _ in p.robot.cuts] == ["good", "in"]
    assert entry(p.robot, "in").state == "DONE" and p.robot.state.reason == reasons.work_done()


@pytest.mark.long
def test_a_planner_that_does_not_answer_does_not_keep_the_work_from_ending() -> None:
    p = Planned((point("in", (0.5, 0.75, 1.05)), point("good", (1.4, 0.75, 1.05))), obstacles=(POST,))
    p.accepted("in", "good").until_valid()
    p.after = 100_000
    p.start()
    finish(p.robot, 60.0)
    assert entry(p.robot, "in").state == "UNREACHABLE" and p.robot.state.reason == reasons.work_done_but(1)


def test_where_nothing_accepted_can_be_reached_no_work_begins_and_that_is_said() -> None:
    p = Planned((point("high", (0.6, 0.75, 2.4)),))
    p.accepted("high").until_valid()
    assert p.robot.ask(intents.Arm(user="ada")).ok
    p.robot.run(0.1)
    assert p.robot.state.allowed["Start"] is not None
    assert p.robot.ask(intents.Start(user="ada")).reason == reasons.none_reachable(1)
    assert p.robot.ask(intents.RejectPoint(user="ada", point_id="high", reason="too high")).ok
    p.robot.run(0.1)
    assert entry(p.robot, "high").state == "REJECTED"
    assert p.robot.ask(intents.Start(user="ada")).reason == reasons.none_accepted()


@pytest.mark.long
def test_what_could_not_be_reached_is_accepted_again_once_a_plan_can() -> None:
    p = Planned((point("in", (0.5, 0.75, 1.05)), point("good", (1.4, 0.75, 1.05))), obstacles=(POST,))
    first = p.accepted("in", "good").until_valid()
    p.robot.run(0.1)
    assert entry(p.robot, "in").state == "UNREACHABLE"
    # The post is gone, which no plan is made anew for; that the robot stands elsewhere is a reason.
    p.robot.obstacles = ()
    assert p.robot.ask(intents.Arm(user="ada")).ok
    p.robot.run(0.05)
    p.robot.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.2, 0.0))
    p.robot.run(1.0)
    p.robot.teleop = None
    p.until_valid_again(first)
    p.robot.run(0.1)
    assert (entry(p.robot, "in").state, entry(p.robot, "in").reason) == ("ACCEPTED", None)
    assert p.robot.ask(intents.Start(user="ada")).ok
    finish(p.robot, 90.0)
    assert {e.state for e in p.robot.state.queue} == {"DONE"}


def test_a_robot_moved_by_hand_voids_the_plan_until_it_rests_and_there_is_another() -> None:
    p = Planned((point("a", (0.9, 0.75, 1.05)),))
    first = p.accepted("a").until_valid()
    assert p.robot.ask(intents.Arm(user="ada")).ok
    p.robot.run(0.05)
    p.robot.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.2, 0.0))
    p.robot.run(1.5)
    assert p.robot.q[0] > 0.1 and len(p.requests) == 1, "nothing is planned while the robot is moved"
    p.robot.teleop = None
    second = p.until_valid_again(first)
    assert p.requests[-1].q[0] == pytest.approx(p.robot.q[0], abs=0.01) and second.plan_hash != first.plan_hash


def test_what_comes_into_view_in_the_way_voids_the_plan_and_the_next_one_knows_it() -> None:
    p = Planned((point("a", (0.5, 0.75, 1.05)),))
    p.accepted("a").until_valid()
    p.robot.obstacles = (POST,)
    p.robot.run(0.1)
    assert p.plans[-1].state in ("void", "planning") and p.plans[-1].reason.code == "new_obstacle"
    assert "post 0" in text_of(p.until_valid().points[0].reason)


def test_without_a_planner_the_work_goes_on_along_the_row() -> None:
    p = Planned((point("b", (0.6, 0.75, 1.05)), point("a", (0.2, 0.75, 1.05))), answer_after=10**9)
    p.accepted("a", "b")
    p.robot.run(3.0)
    assert len(p.requests) == 1 and p.plans[-1].state == "planning"
    p.start()
    finish(p.robot, 60.0)
    assert [point_id for point_id, _ in p.robot.cuts] == ["a", "b"]


def test_a_plan_that_holds_is_neither_made_nor_told_again() -> None:
    """The runner repeats what is latched for late joiners."""
    p = Planned((point("a", (0.4, 0.75, 1.05)),))
    p.accepted("a").until_valid()
    said = len(p.plans)
    p.robot.run(11.0)
    assert len(p.plans) == said and len(p.requests) == 1


def test_a_start_outside_a_joint_limit_is_led_back_in_and_works() -> None:
    p = Planned((point("a", (0.4, 0.75, 1.05)),))
    upper = p.robot.model.limits.upper[ARM_Q]
    p.robot.q[8] = upper[3] + 0.05
    p.accepted("a").until_valid()
    p.start()
    finish(p.robot, 60.0)
    assert entry(p.robot, "a").state == "DONE"
    assert (p.robot.q[ARM_Q] < upper).all()
