"""A plan holds until the world is another one, and then says in which way."""

import numpy as np
import pytest

from controller.planning.plan_manager import ObstacleWatch, place_changed, points_changed
from controller.planning.work_plan import PlanRequest, WorkPlan
from controller.work.point_queue import Ticket
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from tests.controller.test_cuts import PLANNER, point, request

A, B = point("a", 0.3), point("b", 0.9)
PLAN = WorkPlan(PlanRequest(1, np.zeros(12), (A, B)))
WIRE = Capsule("wire", (0.0, 0.75, 1.7), (2.0, 0.75, 1.7), 0.002, 0.002)


def ticket(shown, state="ACCEPTED", accepted=None):
    return Ticket(shown, state=state, accepted=accepted or (shown if state == "ACCEPTED" else None))


def test_what_was_planned_and_what_the_work_has_done_since_leave_it_valid() -> None:
    assert points_changed(PLAN, [ticket(A), ticket(B)]) is None
    assert points_changed(PLAN, [ticket(A, "DONE"), ticket(B), ticket(point("c", 2.0), "PROPOSED")]) is None
    assert points_changed(PLAN, [ticket(A, "CUTTING"), ticket(B, "FAILED_NOT_CUT")]) is None


@pytest.mark.parametrize(
    ("tickets", "why"),
    [
        ([ticket(A), ticket(B), ticket(point("c", 2.0))], reasons.accepted_later("c")),
        ([ticket(A), ticket(point("b", 0.9, revision=2))], reasons.accepted_anew("b")),
        ([ticket(A), ticket(B, accepted=point("b", 0.901))], reasons.accepted_anew("b")),
        ([ticket(A), ticket(B, "REJECTED")], reasons.no_longer_accepted("b")),
        ([ticket(A, "PROPOSED"), ticket(B)], reasons.no_longer_accepted("a")),
        ([ticket(B)], reasons.no_longer_accepted("a")),
    ],
)
def test_other_points_void_it(tickets, why) -> None:
    assert points_changed(PLAN, tickets) == why


def test_a_robot_that_was_moved_voids_it() -> None:
    q = np.zeros(12)
    q[0], q[2], q[6] = 0.04, 0.04, 0.09
    assert place_changed(PLAN, q) is None
    for entry, value, code in ((1, -0.06, "robot_elsewhere"), (2, 0.1, "robot_turned"), (11, -0.2, "joint_elsewhere")):
        away = q.copy()
        away[entry] = value
        assert place_changed(PLAN, away).code == code
    q[3] = 50.0
    assert place_changed(PLAN, q) is None, "where the wheels have turned to means nothing"


def obstacles_changed(plan, now):
    return ObstacleWatch.of(plan).changed(now)


def planned(*obstacles):
    return PLANNER.plan(request(A, obstacles=obstacles))


def test_only_what_stands_in_its_way_where_nothing_stood_voids_it() -> None:
    plan = planned(WIRE)
    assert obstacles_changed(plan, (WIRE,)) is None
    shifted = Capsule("wire", (0.3, 0.77, 1.7), (1.5, 0.77, 1.72), 0.003, 0.003)
    assert obstacles_changed(plan, (shifted,)) is None
    assert obstacles_changed(plan, ()) is None
    x, y, z = WIRE.end
    assert obstacles_changed(plan, (Capsule("wire", WIRE.start, (x + 0.04, y, z), 0.002, 0.002),)) is None
    longer = obstacles_changed(plan, (Capsule("wire", (-0.5, y, z), WIRE.end, 0.002, 0.002),))
    assert longer.code == "new_obstacle" and dict(longer.values)["x"] == pytest.approx(-0.5, abs=0.05)
    assert ("kind", "post") in obstacles_changed(plan, (WIRE, post(1.0))).values
    assert obstacles_changed(plan, (WIRE, post(4.0))) is None, "out of the robot's reach all the way"
    assert ("kind", "wire") in obstacles_changed(planned(), (WIRE,)).values


def cane(x, y=0.75, top=1.15):
    return Capsule("cane", (x, y, 0.95), (x, y, top), 0.004, 0.004, 1, 2)


def test_of_new_canes_only_those_beside_the_tools_line_into_a_cut_void_it() -> None:
    plan = planned(WIRE)
    (cut,) = plan.cuts
    x, y, _ = cut.cut.poses.cut.translation.tolist()
    assert ("kind", "cane") in obstacles_changed(plan, (WIRE, cane(x + 0.08, y))).values
    assert ("kind", "cane") in obstacles_changed(plan, (WIRE, cane(x, y - 0.15))).values
    assert obstacles_changed(plan, (WIRE, *(cane(x + away) for away in (-0.6, -0.2, 0.2, 0.6)))) is None
    known = planned(WIRE, cane(x + 0.08, y))
    assert obstacles_changed(known, (WIRE, cane(x + 0.09, y + 0.02))) is None, "noise moves it by less than that"


@pytest.mark.long
def test_a_thicker_one_voids_it_and_a_thinner_one_does_not() -> None:
    thick = Capsule("wire", WIRE.start, WIRE.end, 0.08, 0.08)
    assert obstacles_changed(planned(WIRE), (thick,)) is not None
    assert obstacles_changed(planned(thick), (WIRE,)) is None


def post(x):
    return Capsule("post", (x, 0.75, 0.0), (x, 0.75, 2.0), 0.05, 0.05)
