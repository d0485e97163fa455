"""A survey is motion like any work: it drives along the row, cuts nothing, and says what perception found."""

import numpy as np
import pytest

from controller.work.survey import looked_again
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, finish, robot, run_until
from tests.support.points import point

UNCLEAR = m.UndecidedSite(reasons.cane_base_hidden(), "another look", 1, 2)
ROBOT = RobotModel()
ASKING = m.UndecidedSite(reasons.canes_at_same_height(), "operator", 1, 3)


def surveying(distance, *undecided_sites, rule=None, **changes):
    r = robot(**changes)
    r.step()
    tell(r, *undecided_sites, rule=rule)
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.Survey(user="ada", distance=distance)).ok
    return r


def tell(r, *undecided_sites, rule=None):
    """What perception says of the row from now on: one point, and what it left open."""
    shown = (point("a", (0.5, 0.75, 1.0), vine=1, spur=1),)
    r.show(shown, undecided_sites=undecided_sites, rule=rule)


def test_it_drives_the_whole_way_with_the_arm_in_its_looking_posture_and_tells_what_was_found():
    r = surveying(1.0, ASKING)
    r.q[ARM_Q] = np.array(CONFIG.work.home) + 0.2
    places = []
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    while r.state.mode == "AUTO":
        assert r.state.phase == "SURVEY" and r.now < 40.0
        places.append(r.q[:3].copy())
        if r.q[0] > 0.05:
            assert np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02
        r.step()
    assert r.state.mode == "READY"
    assert r.state.reason == reasons.surveyed(1, 2, 1, 0, 1)
    assert max(place[0] for place in places) == max(r.q[0], 0.0) or abs(r.q[0] - 1.0) < 0.02
    speed = np.abs(np.diff([place[0] for place in places])) / r.dt
    assert 0.1 < speed.max() < CONFIG.work.survey_speed * 1.05
    assert max(abs(place[1]) for place in places) < 0.01 and not r.cuts


def test_where_places_need_another_look_it_goes_back_over_its_way_once():
    r = surveying(0.6, UNCLEAR)
    finish(r, 40.0)
    assert abs(r.q[0]) < 0.03 and text_of(reasons.survey_returns(1)) in r.events
    assert "1 unclear" in text_of(r.state.reason)


@pytest.mark.parametrize(
    ("system", "out", "back"),
    [("guyot", CONFIG.work.survey_far, CONFIG.work.survey_low), ("spur", CONFIG.work.home, CONFIG.work.home)],
)
def test_over_guyot_vines_the_camera_is_far_on_the_way_out_and_low_on_the_way_back(system, out, back):
    assert tool_height(CONFIG.work.survey_low) - tool_height(CONFIG.work.home) == pytest.approx(-0.2, abs=0.02)
    assert tool_height(CONFIG.work.survey_far) - tool_height(CONFIG.work.home) == pytest.approx(-0.05, abs=0.02)
    r = surveying(0.6, UNCLEAR, rule=m.PruningRule(system=system))
    ways = {1: [], -1: []}
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    while r.state.mode == "AUTO":
        assert r.now < 40.0
        before = r.q[0]
        r.step()
        if abs(r.q[0] - before) > 0.05 * r.dt:
            sense, posture = (1, out) if r.q[0] > before else (-1, back)
            ways[sense].append(np.abs(r.q[ARM_Q] - posture).max())
    assert abs(r.q[0]) < 0.03
    assert all(len(way) > 100 and max(way) < 0.02 for way in ways.values())


def test_it_comes_back_to_its_line_when_it_begins_askew():
    r = robot()
    r.q[2] = 0.08
    r.step()
    tell(r)
    r.step()
    r.ask(intents.Arm(user="ada"))
    assert r.ask(intents.Survey(user="ada", distance=1.5)).ok
    finish(r, 40.0)
    assert abs(r.q[1]) < 0.02 and abs(r.q[2]) < 0.02


def test_it_needs_what_automatic_work_needs_and_no_accepted_point():
    r = robot()
    r.step()
    refused = r.ask(intents.Survey(user="ada"))
    assert not refused.ok and refused.reason.code == "impossible_in_idle"
    r.ask(intents.Arm(user="ada"))
    r.perception = False
    r.step()
    refused = r.ask(intents.Survey(user="ada"))
    assert not refused.ok and refused.reason.code in ("process_silent", "process_gone")


def test_a_pause_ends_it_and_resuming_does_not_begin_it_again():
    r = surveying(2.0)
    run_until(r, lambda s: s is not None and r.q[0] > 0.2, 30.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(1.0)
    at = r.q[0]
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(2.0)
    assert r.state.mode == "READY" and abs(r.q[0] - at) < 0.005


def test_after_a_pause_one_command_goes_on_with_it_to_where_it_was_to_end():
    r = surveying(1.0)
    run_until(r, lambda s: s is not None and r.q[0] > 0.3, 30.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(1.0)
    assert r.ask(intents.Continue(user="ada")).ok
    finish(r, 40.0)
    assert abs(r.q[0] - 1.0) < 0.02 and r.state.reason == reasons.surveyed(1, 1, 1, 0, 0)


def test_on_the_way_back_it_goes_on_back_with_the_camera_where_it_was():
    r = surveying(0.6)
    r.show((), undecided_sites=(UNCLEAR,), rule=m.PruningRule(system="guyot"))
    run_until(r, lambda s: s is not None and text_of(reasons.survey_returns(1)) in r.events and r.q[0] < 0.45, 40.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.5)
    r.q[ARM_Q] = np.array(CONFIG.work.home)
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(0.5)
    assert r.ask(intents.Continue(user="ada")).ok
    run_until(r, lambda s: r.q[0] < 0.3, 30.0)
    assert np.abs(r.q[ARM_Q] - CONFIG.work.survey_low).max() < 0.02
    finish(r, 40.0)
    assert abs(r.q[0]) < 0.03


def test_going_on_needs_what_the_survey_needs():
    r = surveying(1.0)
    run_until(r, lambda s: s is not None and r.q[0] > 0.3, 30.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.perception = False
    r.run(3.0)
    told = r.state.allowed["Continue"]
    assert told is not None and told.code in ("process_silent", "process_gone")
    assert r.ask(intents.Continue(user="ada")).reason == told and r.state.mode == "PAUSED"


def test_the_stop_stops_it():
    r = surveying(2.0)
    run_until(r, lambda s: s is not None and r.q[0] > 0.2, 30.0)
    at = r.q[0]
    r.stop()
    r.run(1.5)
    assert r.state.mode == "ESTOP_LATCHED" and r.q[0] - at < 0.1


def test_what_holds_the_base_back_pauses_it_with_the_reason():
    post = Capsule("post", (1.0, 0.0, 0.0), (1.0, 0.0, 2.0), 0.05, 0.05)
    r = surveying(3.0, obstacles=(post,))
    finish(r, 60.0)
    assert r.state.mode == "PAUSED" and "post" in text_of(r.state.reason)
    assert r.q[0] < 0.9


def test_a_place_left_open_is_looked_at_from_both_sides_and_from_before_it():
    place = m.UndecidedSite(reasons.cane_base_hidden(), "another look", 1, 2, position=(1.9, 0.8, 0.95))
    r = robot()
    r.step()
    tell(r, place)
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    unknown = r.ask(intents.LookAgain(user="ada", vine=1, spur=7))
    assert not unknown.ok and unknown.reason == reasons.site_unknown(1, 7)
    assert r.ask(intents.LookAgain(user="ada", vine=1, spur=2)).ok
    stood = []
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    assert any("READY → AUTO: ada pressed look again" in text for text in r.events)
    while r.state.mode == "AUTO":
        assert r.now < 60.0
        before = r.q[0]
        r.step()
        if abs(r.q[0] - before) < 1e-5 * r.dt and (not stood or abs(stood[-1][0] - r.q[0]) > 0.05):
            stood.append((float(r.q[0]), 1.9 - tool_ahead(r)))
    assert not r.cuts
    places = [x for x, _ in stood if x > 0.1]
    assert len(places) == 3, stood
    np.testing.assert_allclose(np.diff(places), 0.22, atol=0.02)
    assert abs(places[1] - stood[-1][1]) < 0.03, "the camera is before the place once"
    assert r.state.reason == reasons.looked_again_unclear(1, 2, reasons.cane_base_hidden())


def tool_height(arm):
    """Height of the tool with the arm in a posture (m)."""
    return float(ROBOT.pose(np.concatenate([np.zeros(5), arm]), ROBOT.tool_id).translation[2])


def tool_ahead(r):
    """How far ahead of the base the tool is (m)."""
    q = r.q.copy()
    q[:3] = 0.0
    return float(ROBOT.pose(q, ROBOT.tool_id).translation[0])


@pytest.mark.parametrize(
    ("undecided_sites", "points", "says"),
    [
        ((), ("p7",), reasons.looked_again(1, 2, "p7")),
        ((reasons.canes_at_same_height(),), (), reasons.looked_again_asks(1, 2, reasons.canes_at_same_height())),
        ((), (), reasons.looked_again_without_point(1, 2)),
    ],
)
def test_what_came_of_the_look_is_told(undecided_sites, points, says):
    left = tuple(m.UndecidedSite(why, "operator", 1, 2, position=(0.4, 0.8, 0.95)) for why in undecided_sites)
    shown = tuple(point(name, (0.4, 0.75, 1.0), vine=1, spur=2) for name in points)
    told = m.PruningPoints(header=m.Header(), segmenter="none", frames=1, points=shown, undecided_sites=left)
    place = m.UndecidedSite(reasons.cut_place_hidden(), "another look", 1, 2, position=(0.4, 0.8, 0.95))
    assert looked_again(told, place) == says
