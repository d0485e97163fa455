import math

import numpy as np
import pytest
from controller_at_work import CONFIG, entry, finish, point, robot

from controller.approaches import LARGEST, Approaches
from controller.core import Controller
from controller.journal import ApproachRow, Journal
from controller.planning.cuts import CutPlanner
from controller.work_plan import PlanRequest
from rolling_panda import intents
from rolling_panda.config import RobotConfig
from rolling_panda.robot_model import ARM_Q

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
    assert r.ask(intents.TurnApproach(user="ada", point_id="a", azimuth=math.radians(degrees))).ok
    assert r.ask(intents.Start(user="ada")).ok
    finish(r, 40.0)
    assert entry(r, "a").state == "DONE"
    assert entry(r, "a").azimuth == pytest.approx(math.radians(degrees))
    assert math.degrees(azimuth_of(r.cuts[0][1])) == pytest.approx(degrees, abs=2.0)


def test_the_plan_says_at_once_what_a_turn_means():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.home
    planner = CutPlanner(CONFIG, RobotConfig())
    straight = planner.plan(PlanRequest(1, q, (POINT,)))
    turned = planner.plan(PlanRequest(1, q, (POINT,), turned=(("a", 0.5),)))
    assert math.degrees(azimuth_of(straight.cuts[0].cut.poses.cut.homogeneous)) == pytest.approx(0.0, abs=1.0)
    assert azimuth_of(turned.cuts[0].cut.poses.cut.homogeneous) == pytest.approx(0.5, abs=0.02)
    assert turned.digest != straight.digest


def test_what_cannot_be_turned_is_refused():
    r = accepted(robot())
    too_far = r.ask(intents.TurnApproach(user="ada", point_id="a", azimuth=LARGEST + 0.1))
    assert not too_far.ok and "at most 75°" in too_far.reason
    assert "no point" in r.ask(intents.TurnApproach(user="ada", point_id="b", azimuth=0.1)).reason
    assert r.ask(intents.Start(user="ada")).ok
    r.run(1.5)
    assert r.state.active_point_id == "a"
    assert "being worked on" in r.ask(intents.TurnApproach(user="ada", point_id="a", azimuth=0.1)).reason


def test_a_restart_keeps_it_and_taking_it_back_leaves_it_to_the_search():
    journal = Journal()
    before = Approaches(journal)
    before.turn("a", 0.4, "ada")
    before.turn("b", 0.2, "ada")
    before.turn("b", None, "ada")
    rows = tuple((record.name, record.body) for record in journal.take())
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
