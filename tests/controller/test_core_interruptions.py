"""Operators who change their minds at the worst moment: nothing is cut or moved that was not asked for last."""

import msgspec
import numpy as np
import pytest

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from rolling_panda.model.robot import ARM_Q
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, finish, robot, run_until, working
from tests.support.points import point


def until_retreating_from_the_first(r):
    while not r.cuts or r.state.phase != "RETREAT":
        r.step()
        assert r.now < 60.0


def cut_at(r, point_id):
    return next(T for cut, T in r.cuts if cut == point_id)[:3, 3]


def test_a_point_accepted_anew_at_another_place_while_the_tool_comes_out_is_cut_there():
    first, second = point("p0", (0.2, 0.75, 1.05)), point("p1", (0.5, 0.75, 1.05))
    r = working((first, second))
    until_retreating_from_the_first(r)
    moved = point("p1", (0.54, 0.75, 1.05), revision=2, cane=1)
    r.show((first, moved))
    r.step()
    assert r.ask(intents.AcceptPoint(user="ada", point_id="p1", revision=2)).ok
    finish(r, 100.0)
    assert np.linalg.norm(cut_at(r, "p1") - moved.position) < 0.0015


def test_a_point_rejected_and_accepted_in_one_period_is_cut_where_it_was_accepted_last():
    r = working((point("p0", (0.5, 0.75, 1.05)),))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH" and s.T_odom_tool_desired is not None, 10.0)
    for revision in range(2, 6):
        last = point("p0", (0.496 + 0.004 * revision, 0.75, 1.05), revision=revision)
        r.show((last,))
        r.step()
        assert r.ask(intents.RejectPoint(user="ada", point_id="p0")).ok
        assert r.ask(intents.AcceptPoint(user="ada", point_id="p0", revision=revision)).ok
    finish(r, 60.0)
    assert np.linalg.norm(cut_at(r, "p0") - last.position) < 0.0015


def test_after_a_pause_the_next_cut_is_planned_from_where_the_robot_is_then():
    shown = point("p0", (0.2, 0.75, 1.05)), point("p1", (0.5, 0.75, 1.05))
    r = working(shown)
    until_retreating_from_the_first(r)
    assert r.ask(intents.Pause(user="ada")).ok
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(0.5)
    # Meanwhile it is moved away from the row, too far for the plan that was made on the way out of the first cut.
    r.q[1] -= 0.2
    r.run(0.1)
    assert r.ask(intents.Start(user="ada")).ok
    finish(r, 60.0)
    assert entry(r, "p1").reason.code == "not_reachable"


def test_nothing_begins_to_move_while_the_blades_close():
    r = working((point("p0", (0.2, 0.75, 1.05)),))
    while not r.cuts:
        r.step()
    assert r.ask(intents.Pause(user="ada")).ok
    assert r.ask(intents.Resume(user="ada")).ok
    for intent in (intents.Start(user="ada"), intents.Home(user="ada")):
        assert r.ask(intent).reason == reasons.blades_closing()
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.3, 0.0))
    # The cut ends, but what was held before moves nothing.
    r.run(1.0)
    assert r.state.mode == "READY" and abs(r.q[0]) < 0.3 and np.abs(r.xi).max() < 1e-3
    r.teleop = None
    r.run(0.05)
    assert r.ask(intents.Home(user="ada")).ok


def homing():
    r = robot()
    r.q[ARM_Q] += 0.3
    r.run(0.05)
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.3)
    assert np.abs(r.xi).max() > 0.05
    return r


def test_a_pause_stops_the_way_home():
    r = homing()
    assert r.state.allowed["Pause"] is None
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.4)
    assert np.abs(r.xi).max() < 1e-3
    assert r.state.mode == "READY" and "stopped by ada" in text_of(r.state.reason)


def test_a_hold_pressed_on_the_way_home_moves_nothing_when_the_arm_is_there():
    r = homing()
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.2, 0.0))
    r.run(6.0)
    assert r.state.mode == "READY" and r.state.reason == reasons.arm_home()
    assert abs(r.q[0]) < 1e-3


WAITS = reasons.waits_for_picture(CONFIG.supervision.obstacles_max_age_s)


def without_pictures(r, seconds):
    """The newest picture is too old from now on; returns the velocities commanded, without the braking."""
    stamp = r.now - CONFIG.supervision.obstacles_max_age_s - 0.1
    r.hear(Obstacles(header=m.Header(stamp, "odom"), capsules=r.obstacles))
    r.deaf.add(Obstacles)
    r.run(0.5)
    before = len(r.record)
    r.run(seconds - 0.5)
    return np.array(r.record[before:])


@pytest.mark.long
@pytest.mark.parametrize(("phase", "after_s"), [("APPROACH", 0.5), ("ADVANCE", 1.0), ("CUT", 0.1), ("RETREAT", 0.1)])
def test_without_a_new_picture_the_robot_stands_and_goes_on_by_itself(phase, after_s):
    shown = point("p0", (0.2, 0.75, 1.05)), point("p1", (0.9, 0.75, 1.05))
    slow = msgspec.structs.replace(CONFIG, work=msgspec.structs.replace(CONFIG.work, reach_timeout_s=1.0))
    r = working(shown, config=slow)
    run_until(r, lambda s: s is not None and s.phase == phase, 20.0)
    r.run(after_s)
    assert r.state.phase == phase
    resting = without_pictures(r, 12.0)
    assert r.state.mode == "AUTO" and r.state.reason == WAITS
    assert np.abs(resting).max() < 1e-3
    r.deaf.clear()
    finish(r, 60.0)
    assert [each.state for each in r.state.queue] == ["DONE", "DONE"]
    for each in shown:
        assert np.linalg.norm(cut_at(r, each.point_id) - each.position) < 0.0015
    assert sum("until a newer camera frame" in line for line in r.events) == 1


def test_a_survey_stands_without_a_new_picture_and_takes_that_for_no_obstacle():
    r = robot()
    r.run(0.05)
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.Survey(user="ada", distance=1.0)).ok
    run_until(r, lambda _: np.abs(r.xi[:2]).max() > 0.1, 5.0)
    resting = without_pictures(r, 12.0)
    assert r.state.reason == WAITS and np.abs(resting).max() < 1e-3
    r.deaf.clear()
    finish(r, 60.0)
    assert r.q[0] > 0.95 and r.state.reason.code == "survey_blind"


def test_work_that_is_started_with_too_old_a_picture_begins_with_a_newer_one():
    r = robot()
    r.step()
    r.show((point("p0", (0.2, 0.75, 1.05)),))
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok and r.ask(intents.AcceptAll(user="ada")).ok
    without_pictures(r, 1.0)
    assert r.ask(intents.Start(user="ada")).ok
    r.run(0.1)
    before = len(r.record)
    r.run(5.0)
    assert r.state.mode == "AUTO" and r.state.reason == WAITS
    assert np.abs(np.array(r.record[before:])).max() < 1e-3
    r.deaf.clear()
    finish(r, 60.0)
    assert entry(r, "p0").state == "DONE"


def test_a_picture_that_does_not_come_pauses_the_work():
    r = working((point("p0", (0.2, 0.75, 1.05)),))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH", 5.0)
    without_pictures(r, CONFIG.supervision.picture_wait_s + 0.2)
    assert r.state.mode == "PAUSED" and r.state.reason.code == "obstacles_stale"
    r.deaf.clear()
    r.run(3.0)
    assert r.state.mode == "PAUSED", "from here only an operator goes on"
