"""Who holds control moves the robot, nobody else, and only for as long as they are heard."""

import numpy as np
import pytest

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import BaseVelocity, ControlState, StopRecord, TeleopTarget
from rolling_panda.reasons import said, text_of
from tests.support.controller_at_work import CONFIG, robot, run_until, working
from tests.support.points import point
from tests.support.sent import every, newest


def far_at_work():
    r = working((point("a", (2.0, 0.75, 1.0)),))
    r.run(3.0)
    assert np.abs(r.xi).max() > 0.1
    return r


def test_without_being_heard_the_robot_stops_pauses_and_stays_so():
    r = far_at_work()
    r.people.clear()
    r.run(1.5)
    assert r.state.mode == "PAUSED" and r.state.reason == reasons.control_lapsed("ada", 1.0)
    assert np.abs(r.xi).max() < 2e-3
    r.people.add("ada")
    r.run(2.0)
    assert r.state.mode == "PAUSED" and np.abs(r.xi).max() < 1e-6


def test_somebody_else_neither_starts_nor_moves_what_another_holds():
    r = robot()
    r.step()
    r.show((point("a", (0.4, 0.75, 1.0)),))
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    for intent in (intents.Start(user="bob"), intents.Home(user="bob")):
        assert r.ask(intent).reason == reasons.control_held("ada")
    assert r.ask(intents.AcceptAll(user="bob")).ok
    # A hold that begins with a change of mode would count for nothing at all.
    r.step()
    r.teleop = TeleopTarget(sequence=1, hold=True, user="bob", base=BaseVelocity(0.2, 0.0))
    r.run(0.5)
    assert r.state.mode == "READY" and np.abs(r.xi).max() < 1e-6
    assert text_of(reasons.teleoperation_refused(reasons.control_held("ada"))) in r.events
    # Anybody who may operate may pause.
    assert r.ask(intents.Start(user="ada")).ok
    assert r.ask(intents.Pause(user="bob")).ok


def test_a_viewer_moves_nothing():
    r = robot()
    r.step()
    answer = r.ask(intents.Arm(user="eve", role="viewer"))
    assert not answer.ok and answer.reason == reasons.viewer_only()


def test_who_takes_control_gets_a_robot_at_rest_and_has_to_resume():
    r = far_at_work()
    assert r.ask(intents.TakeControl(user="bob")).reason == reasons.control_unconfirmed("ada")
    assert r.ask(intents.TakeControl(user="bob", confirm=True)).ok
    out = r.step()
    assert r.controller.mode == "PAUSED"
    while "bob" not in [control.user for control in every(out, ControlState)]:
        moving = np.abs(newest(out, m.MotionCommand).xi).max()
        out = r.step()
        assert r.now < 10.0
    assert moving < 0.05 and not np.any(newest(out, m.MotionCommand).xi)
    assert r.ask(intents.Resume(user="bob")).reason != reasons.control_held("ada")
    assert r.ask(intents.Start(user="ada")).reason == reasons.control_held("bob")
    assert r.ask(intents.Start(user="bob")).ok


def test_giving_control_back_in_motion_pauses():
    r = far_at_work()
    assert r.state.interrupted == ""
    assert r.ask(intents.ReturnControl(user="ada")).ok
    r.run(0.5)
    assert np.abs(r.xi).max() < 2e-3
    assert (r.state.mode, r.state.interrupted) == ("PAUSED", "work")


def test_a_stop_is_for_a_supervisor_to_reset():
    r = far_at_work()
    r.stop()
    r.run(0.3)
    refused = r.ask(intents.Reset(user="ada", role="operator", reason="looked"))
    assert not refused.ok and refused.reason.code == "right_missing"
    assert r.ask(intents.Reset(user="ada", role="supervisor", reason="looked")).ok


@pytest.mark.parametrize("phase", ["APPROACH", "ADVANCE", "CUT"])
def test_when_nobody_watches_no_further_cut_begins_the_tool_comes_out_and_work_pauses(phase):
    r = working((point("a", (0.4, 0.75, 1.0)), point("b", (0.7, 0.75, 1.0))))
    run_until(r, lambda s: s is not None and s.phase == phase, 30.0)
    r.watching = False
    run_until(r, lambda s: s.mode != "AUTO", r.now + 12.0)
    assert r.state.mode == "PAUSED" and "seen the robot" in text_of(r.state.reason)
    assert len(r.cuts) <= 1
    clear = CONFIG.work.row_distance - CONFIG.work.clearance + 0.08
    if phase != "APPROACH":
        assert r.model.kinematics(r.q).T_odom_tool.translation[1] < clear
    r.watching = True
    r.run(1.0)
    assert r.state.mode == "PAUSED" and np.abs(r.xi[2:]).max() < 1e-3


def ready_and_unwatched():
    r = robot()
    r.watching = False
    r.step()
    r.show((point("a", (0.4, 0.75, 1.0)),))
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.AcceptAll(user="ada")).ok
    return r


def test_work_does_not_begin_unwatched():
    r = ready_and_unwatched()
    assert r.ask(intents.Start(user="ada")).reason.code == "never_watched"


@pytest.mark.parametrize(("age_s", "begins"), [(1.9, True), (2.1, False)])
def test_what_who_asks_has_seen_comes_with_what_they_ask(age_s, begins):
    r = ready_and_unwatched()
    answer = r.ask(intents.Start(user="ada", view_age_s=age_s))
    assert answer.reason == (None if begins else reasons.unwatched(2.1, 2.0))


def test_what_a_viewer_has_seen_lets_nothing_begin():
    r = ready_and_unwatched()
    assert not r.ask(intents.Arm(user="eve", role="viewer", view_age_s=0.1)).ok
    assert r.ask(intents.Start(user="ada")).reason.code == "never_watched"


def test_a_controller_that_starts_while_a_stop_is_latched_is_stopped():
    r = robot()
    r.controller.restore((), (StopRecord("s9", "server", "eve", said("dog in the row"), 1.0),))
    assert r.controller.mode == "ESTOP_LATCHED"
    r.step()
    refused = r.ask(intents.Arm(user="ada"))
    assert not refused.ok and refused.reason.code == "impossible_in_estop"
