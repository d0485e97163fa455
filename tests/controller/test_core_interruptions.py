"""Operators who change their minds at the worst moment: nothing is cut or moved that was not asked for last."""

import numpy as np

from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from rolling_panda.model.robot import ARM_Q
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import entry, finish, robot, run_until, working
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
