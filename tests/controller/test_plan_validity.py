"""A plan holds until the world is another one, and then says in which way."""

import numpy as np
import pytest

from controller.planning.plan_validity import ObstacleWatch, place_changed, points_changed
from controller.planning.work_plan import PlanRequest, WorkPlan
from controller.work.point_queue import Ticket
from rolling_panda.messages.perception import Capsule
from tests.controller.test_cuts import PLANNER, point, request

A, B = point("a", 0.3), point("b", 0.9)
PLAN = WorkPlan(PlanRequest(1, np.zeros(12), (A, B)))
WIRE = Capsule("wire", (0.0, 0.75, 1.7), (2.0, 0.75, 1.7), 0.002, 0.002)


def ticket(shown, state="ACCEPTED", accepted=None):
    return Ticket(shown, state=state, accepted=accepted or (shown if state == "ACCEPTED" else None))


def test_what_was_planned_and_what_the_work_has_done_since_leave_it_valid() -> None:
    assert points_changed(PLAN, [ticket(A), ticket(B)]) == ""
    assert points_changed(PLAN, [ticket(A, "DONE"), ticket(B), ticket(point("c", 2.0), "PROPOSED")]) == ""
    assert points_changed(PLAN, [ticket(A, "CUTTING"), ticket(B, "FAILED_NOT_CUT")]) == ""


@pytest.mark.parametrize(
    ("tickets", "words"),
    [
        ([ticket(A), ticket(B), ticket(point("c", 2.0))], "c was accepted after it was made"),
        ([ticket(A), ticket(point("b", 0.9, revision=2))], "b was accepted again"),
        ([ticket(A), ticket(B, accepted=point("b", 0.901))], "b was accepted again"),
        ([ticket(A), ticket(B, "REJECTED")], "b is no longer accepted"),
        ([ticket(A, "PROPOSED"), ticket(B)], "a is no longer accepted"),
        ([ticket(B)], "a is no longer accepted"),
    ],
)
def test_other_points_void_it(tickets, words) -> None:
    assert points_changed(PLAN, tickets) == words


def test_a_robot_that_was_moved_voids_it() -> None:
    q = np.zeros(12)
    q[0], q[2], q[6] = 0.04, 0.04, 0.09
    assert place_changed(PLAN, q) == ""
    for entry, value, words in ((1, -0.06, "0.07 m"), (2, 0.1, "6°"), (11, -0.2, "0.20 rad")):
        away = q.copy()
        away[entry] = value
        assert words in place_changed(PLAN, away)
    q[3] = 50.0
    assert place_changed(PLAN, q) == "", "where the wheels have turned to means nothing"


def obstacles_changed(plan, now):
    return ObstacleWatch.of(plan).changed(now)


def planned(*obstacles):
    return PLANNER.plan(request(A, obstacles=obstacles))


def test_only_what_stands_in_its_way_where_nothing_stood_voids_it() -> None:
    plan = planned(WIRE)
    assert obstacles_changed(plan, (WIRE,)) == ""
    shifted = Capsule("wire", (0.3, 0.77, 1.7), (1.5, 0.77, 1.72), 0.003, 0.003)
    assert obstacles_changed(plan, (shifted,)) == ""
    assert obstacles_changed(plan, ()) == ""
    x, y, z = WIRE.end
    assert obstacles_changed(plan, (Capsule("wire", WIRE.start, (x + 0.04, y, z), 0.002, 0.002),)) == ""
    assert "a wire is seen at (-0.5," in obstacles_changed(
        plan, (Capsule("wire", (-0.5, y, z), WIRE.end, 0.002, 0.002),)
    )
    assert "a post is seen at (1.0, 0.8," in obstacles_changed(plan, (WIRE, post(1.0)))
    assert obstacles_changed(plan, (WIRE, post(4.0))) == "", "out of the robot's reach all the way"
    assert "a wire is seen" in obstacles_changed(planned(), (WIRE,))


def cane(x, y=0.75, top=1.15):
    return Capsule("cane", (x, y, 0.95), (x, y, top), 0.004, 0.004, 1, 2)


def test_of_new_canes_only_those_beside_the_tools_line_into_a_cut_void_it() -> None:
    plan = planned(WIRE)
    (cut,) = plan.cuts
    x, y, _ = cut.cut.poses.cut.translation.tolist()
    assert "a cane is seen" in obstacles_changed(plan, (WIRE, cane(x + 0.08, y)))
    assert "a cane is seen" in obstacles_changed(plan, (WIRE, cane(x, y - 0.15)))
    assert obstacles_changed(plan, (WIRE, *(cane(x + away) for away in (-0.6, -0.2, 0.2, 0.6)))) == ""
    known = planned(WIRE, cane(x + 0.08, y))
    assert obstacles_changed(known, (WIRE, cane(x + 0.09, y + 0.02))) == "", "noise moves it by less than that"


def test_a_thicker_one_voids_it_and_a_thinner_one_does_not() -> None:
    thick = Capsule("wire", WIRE.start, WIRE.end, 0.08, 0.08)
    assert obstacles_changed(planned(WIRE), (thick,)) != ""
    assert obstacles_changed(planned(thick), (WIRE,)) == ""


def post(x):
    return Capsule("post", (x, 0.75, 0.0), (x, 0.75, 2.0), 0.05, 0.05)
