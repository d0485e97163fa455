"""The order of work and approach directions."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.core import Controller
from controller.ledger.journal import ApproachRow, Journal, OrderRow
from controller.planning.cuts import CutPlanner
from controller.planning.work_plan import PlanRequest
from controller.work.order import LARGEST, Approaches, WorkOrder
from controller.work.tries import Tried
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.model.robot import ARM_Q
from tests.support.controller_at_work import CONFIG, entry, finish, robot
from tests.support.points import point

NAMES = tuple("abcdef")


def everything(_):
    return True


def test_without_a_plan_or_a_person_the_row_says():
    assert WorkOrder(Journal()).arranged(NAMES, everything) == list(NAMES)


def test_a_plan_orders_what_it_names_and_leaves_the_rest_in_its_place():
    order = WorkOrder(Journal())
    order.plan(("e", "b"))
    assert order.arranged(NAMES, everything) == list("aecdbf")


def test_who_moves_a_point_orders_all_that_is_accepted_and_the_next_one_comes_last():
    order = WorkOrder(Journal())
    order.plan(tuple("cba"))
    assert order.move("a", "c", 0, "ada", tuple("cba")) is None
    assert order.state.user == "ada" and order.state.revision == 1
    assert order.arranged(NAMES, set("abc").__contains__) == list("acbdef")
    assert order.arranged(NAMES, set("abcd").__contains__) == list("acbdef")
    assert order.arranged(("0", *NAMES), set("0abc").__contains__) == ["a", "c", "b", "0", "d", "e", "f"]


def test_what_is_held_comes_first_until_it_is_let_go_or_a_person_says_otherwise():
    order = WorkOrder(Journal())
    assert order.hold(("d", "b")) and not order.hold(("d", "b"))
    order.plan(tuple("cbd"))
    assert order.arranged(NAMES, set("abcd").__contains__) == list("dbacef")
    assert order.move("a", "d", 0, "ada", tuple("dbac")) is None
    assert order.arranged(NAMES, set("abcd").__contains__) == list("adbcef")
    assert order.give_back(1) is None and order.hold(())
    assert order.arranged(NAMES, set("abcd").__contains__) == list("acbdef")


def test_of_two_people_who_move_at_once_the_second_is_told():
    order = WorkOrder(Journal())
    assert order.move("a", "", 0, "ada", NAMES) is None
    why = order.move("b", "", 0, "bob", NAMES)
    assert why == reasons.order_changed_by("ada", 0, 1)
    assert order.move("b", "", 1, "bob", NAMES) is None


def test_what_cannot_be_moved_is_refused_and_changes_nothing():
    order = WorkOrder(Journal())
    assert order.move("x", "", 0, "ada", NAMES) == reasons.not_in_order("x")
    assert order.move("a", "x", 0, "ada", NAMES) == reasons.not_in_order("x")
    assert order.move("a", "a", 0, "ada", NAMES) == reasons.before_itself("a")
    assert order.reset_refused == reasons.order_of_plan()
    assert order.state.revision == 0 and order.by_hand == ()


def test_the_plans_order_is_one_press_away():
    order = WorkOrder(Journal())
    order.plan(tuple("fedcba"))
    order.move("a", "f", 0, "ada", tuple("fedcba"))
    assert order.arranged(NAMES, everything)[0] == "a"
    assert order.reset_refused is None and order.give_back(1) is None
    assert order.arranged(NAMES, everything) == list("fedcba")


def test_a_restart_keeps_the_order_and_its_count():
    journal = Journal()
    before = WorkOrder(journal)
    before.move("d", "a", 0, "ada", NAMES)
    (record,) = journal.drain()
    assert (record.kind, record.name) == ("order", "order")
    row = msgspec.json.decode(msgspec.json.encode(record.body), type=OrderRow)
    after = WorkOrder(Journal())
    after.restore(row)
    assert after.arranged(NAMES, everything) == before.arranged(NAMES, everything) == list("dabcef")
    assert after.state == before.state


def test_what_was_tried_comes_last_unless_people_put_it_elsewhere():
    order = WorkOrder(Journal())
    assert order.arranged(NAMES, everything, {"b", "d"}) == list("acefbd")
    order.plan(tuple("fedcba"))
    assert order.arranged(NAMES, everything, {"f"}) == list("edcbaf")
    order.move("f", "e", 0, "ada", tuple("edcbaf"))
    assert order.arranged(NAMES, everything, {"f"}) == list("fedcba")


@given(st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(("", *NAMES))), max_size=8), st.permutations(NAMES))
def test_nothing_is_lost_or_doubled_and_each_move_is_what_was_asked(moves, planned):
    order = WorkOrder(Journal())
    order.plan(tuple(planned))
    for name, before in moves:
        accepted = order.arranged(NAMES, everything)
        if order.move(name, before, order.state.revision, "ada", accepted):
            assert name == before
            continue
        after = order.arranged(NAMES, everything)
        assert sorted(after) == sorted(NAMES)
        place = after.index(name)
        assert after[place + 1 : place + 2] == ([before] if before else [])
        assert [each for each in after if each != name] == [each for each in accepted if each != name]


POINT = point("a", (0.5, 0.75, 1.05))


def accepted(r):
    r.step()
    r.show((POINT,))
    r.step()
    for intent in (intents.Arm(user="ada"), intents.AcceptAll(user="ada")):
        assert r.ask(intent).ok
    return r


def azimuth_of(T):
    """Turn of the approach about an upright cane, from straight at the row (rad)."""
    x, y = T[:2, 2]
    return math.atan2(-x, y)


@pytest.mark.parametrize("degrees", [-40.0, 30.0])
def test_a_cut_is_approached_from_where_somebody_wants_it(degrees):
    r = accepted(robot())
    assert r.ask(intents.SetApproach(user="ada", point_id="a", azimuth=math.radians(degrees))).ok
    assert r.ask(intents.Start(user="ada")).ok
    finish(r, 40.0)
    assert entry(r, "a").state == "DONE"
    assert entry(r, "a").azimuth == pytest.approx(math.radians(degrees))
    assert math.degrees(azimuth_of(r.cuts[0][1])) == pytest.approx(degrees, abs=2.0)


def test_the_plan_says_at_once_what_a_turn_means():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    planner = CutPlanner(CONFIG, RobotConfig())
    straight = planner.plan(PlanRequest(1, q, (POINT,)))
    turned = planner.plan(PlanRequest(1, q, (POINT,), turned=(("a", 0.5),)))
    assert math.degrees(azimuth_of(straight.cuts[0].cut.poses.cut.homogeneous)) == pytest.approx(0.0, abs=1.0)
    assert azimuth_of(turned.cuts[0].cut.poses.cut.homogeneous) == pytest.approx(0.5, abs=0.02)
    assert turned.digest != straight.digest


@pytest.mark.long
def test_the_plan_puts_a_cut_that_was_tried_last_and_comes_from_elsewhere():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    planner, far = CutPlanner(CONFIG, RobotConfig()), point("b", (1.5, 0.75, 1.05))
    before = planner.plan(PlanRequest(1, q, (POINT, far)))
    tries = (("a", (Tried(before.cuts[0].cut.approach, ((0.45, 0.7, 0.8), (0.45, 0.7, 1.3))),)),)
    after = planner.plan(PlanRequest(1, q, (POINT, far), tries=tries))
    assert [cut.point.point_id for cut in before.cuts] == ["a", "b"]
    assert [cut.point.point_id for cut in after.cuts] == ["b", "a"]
    assert all(cut.rollout.cut_s is not None for cut in after.cuts)
    assert math.dist(after.cuts[1].cut.approach, before.cuts[0].cut.approach) > 0.15
    assert after.digest != before.digest
    by_hand = planner.plan(PlanRequest(1, q, (POINT, far), order=("a", "b"), tries=tries))
    assert [cut.point.point_id for cut in by_hand.cuts] == ["a", "b"]


def test_what_cannot_be_turned_is_refused():
    r = accepted(robot())
    too_far = r.ask(intents.SetApproach(user="ada", point_id="a", azimuth=LARGEST + 0.1))
    assert not too_far.ok and too_far.reason.code == "approach_too_far"
    assert r.ask(intents.SetApproach(user="ada", point_id="b", azimuth=0.1)).reason == reasons.point_unknown("b")
    assert r.ask(intents.Start(user="ada")).ok
    r.run(1.5)
    assert r.state.active_point_id == "a"
    assert r.ask(intents.SetApproach(user="ada", point_id="a", azimuth=0.1)).reason == reasons.point_worked_on("a")


def test_a_restart_keeps_it_and_taking_it_back_leaves_it_to_the_search():
    journal = Journal()
    before = Approaches(journal)
    before.turn("a", 0.4, "ada")
    before.turn("b", 0.2, "ada")
    before.turn("b", None, "ada")
    rows = tuple((record.name, record.body) for record in journal.drain())
    assert [kind.azimuth for _, kind in rows] == [0.4, 0.2, None]
    after = Approaches(Journal())
    after.restore(rows)
    assert after.turned == before.turned == (("a", 0.4),)
    controller = Controller(CONFIG, RobotConfig())
    controller.restore((), approaches=(("a", ApproachRow(azimuth=0.4)),))
    r = robot()
    r.controller = controller
    r.step()
    r.show((POINT,))
    r.run(0.2)
    assert entry(r, "a").azimuth == 0.4
