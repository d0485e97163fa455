import numpy as np
import pytest

from controller.ledger.journal import LedgerState
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.robot import RejectionCount
from rolling_panda.messages.supervision import BaseVelocity, ControlState, StopState, TeleopTarget
from rolling_panda.model.robot import ARM_Q
from rolling_panda.reasons import severity_of, text_of
from rolling_panda.transport.inbox import Inbox
from tests.support.controller_at_work import CONFIG, robot, run_until
from tests.support.fake_wire import as_received
from tests.support.sent import every, newest


def ready():
    r = robot()
    r.q[ARM_Q] = CONFIG.work.reach
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    run_until(r, lambda s: s is not None and s.mode == "READY", 1.0)
    return r


def on_the_way_home():
    r = ready()
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.1)
    return r


def stays(r):
    """The arm stays where it is, armed and with somebody who holds control."""
    before = r.q.copy()
    r.run(1.0)
    assert r.state.mode == "READY" and np.abs(r.q - before).max() < 1e-3


def test_what_ends_a_mode_ends_what_moved_in_it():
    r = on_the_way_home()
    assert r.state.reason == reasons.homing_arm()
    r.stop()
    r.run(0.2)
    assert r.state.mode == "ESTOP_LATCHED"
    assert r.ask(intents.Reset(user="ada", role="supervisor", reason="checked")).ok
    r.run(0.2)
    assert r.ask(intents.Arm(user="ada")).ok
    stays(r)


def test_a_lost_server_ends_the_way_home_without_a_change_of_mode():
    r = on_the_way_home()
    r.server = False
    r.run(3.0)
    stopped = reasons.homing_stopped(reasons.process_gone("server"))
    assert r.events.count(text_of(stopped)) == 1, r.events
    r.server = True
    stays(r)


def test_who_is_heard_no_more_ends_the_way_home_with_a_warning_and_is_not_told_so_where_nothing_moves():
    r = on_the_way_home()
    r.people.clear()
    stopped = reasons.homing_stopped(reasons.control_lapsed("ada", 1.0))
    assert told(outputs(r, 1.5)).count(stopped) == 1 and severity_of(stopped) == "warning"
    assert r.controller.mode == "READY"
    r.people.add("ada")
    r.run(0.1)
    assert r.ask(intents.TakeControl(user="ada")).ok
    r.run(0.1)
    r.people.clear()
    assert stopped not in told(outputs(r, 1.5))


def test_an_operator_stops_the_way_home_and_is_named():
    r = on_the_way_home()
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.state.mode == "READY"
    assert r.state.reason == reasons.homing_stopped_by("ada")


def bridge_says(r, **changes):
    """The bridge's state has these values from now on."""
    r.bridge_changes = changes


def outputs(r, seconds):
    """What the controller sends in a time, the newest last."""
    return [r.step() for _ in range(round(seconds / r.dt))]


def said(outs, kind):
    """The messages of a type in the order in which they were sent."""
    return [message for out in outs for message in every(out, kind)]


def told(outs):
    return [event.reason for out in outs for event in every(out, m.LogEvent)]


def test_a_change_of_mode_is_a_warning_from_a_pause_on():
    r = ready()
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    said = told(outputs(r, 0.1))
    assert (reasons.mode_changed("READY", "TELEOP", reasons.moved_by_hand("ada"))) in said
    assert r.ask(intents.Pause(user="ada")).ok
    paused = reasons.robot_halted("TELEOP", "PAUSED", reasons.command_by("pause", "ada"))
    assert paused in told(outputs(r, 0.1)) and severity_of(paused) == "warning"


def test_who_commands_the_robot_is_told_and_that_another_controller_does_is_a_warning_and_a_fault():
    r = robot()
    assert (reasons.controller_commands(1)) in told(outputs(r, 0.1))
    assert r.ask(intents.Arm(user="ada")).ok
    bridge_says(r, holder=m.fingerprint("cafe"))
    outs = outputs(r, 0.1)
    assert told(outs).count(reasons.controller_waits()) == 1
    assert severity_of(reasons.controller_waits()) == "warning"
    assert r.controller.mode == "FAULT" and newest(outs[-1], m.MotionCommand) is None


#: Longer than braking takes, and shorter.
LONG, SHORT = 0.5, 0.3


def moved_by_others(r):
    """The bridge is told to move by a command that this controller has not sent."""
    bridge_says(r, moving=True, sequence=10**6)


def test_a_robot_that_moves_by_commands_of_others_is_stopped_under_another_token():
    r = ready()
    moved_by_others(r)
    assert not said(outputs(r, SHORT), m.StopRequest), "the robot may be braking"
    outs = outputs(r, LONG - SHORT)
    (stop,) = {as_received(stop) for stop in said(outs, m.StopRequest)}
    assert (stop.source, stop.user) == ("controller", "") and stop.reason == reasons.foreign_motion()
    assert r.controller.mode == "ESTOP_LATCHED"
    [given_back] = [token for token in said(outs, m.TokenRequest) if token.releases]
    asked_anew = said(outs, m.TokenRequest)[-1].token
    assert asked_anew != given_back.token
    # It is sent until the bridge has it, and no longer.
    assert newest(r.step(), m.StopRequest) == stop
    r.stop_id = stop.stop_id
    assert newest(r.step(), m.StopRequest) is None


def test_motion_that_ends_in_time_and_begins_again_is_no_motion_of_others():
    r = ready()
    for _ in range(3):
        moved_by_others(r)
        assert not said(outputs(r, SHORT), m.StopRequest)
        r.bridge_changes = {}
        assert not said(outputs(r, 0.05), m.StopRequest)


def test_a_hold_of_somebody_else_ends_the_motion_of_who_has_control():
    r = ready()
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    outputs(r, 0.3)
    assert r.controller.mode == "TELEOP"
    r.teleop = TeleopTarget(sequence=1, hold=True, user="bob", base=BaseVelocity(0.1, 0.0))
    said = told(outputs(r, 0.05))
    assert (reasons.mode_changed("TELEOP", "READY", reasons.hold_ended())) in said
    r.run(1.0)
    assert r.controller.mode == "READY" and np.abs(r.xi).max() < 1e-3


def test_a_hold_gives_control_that_nobody_has_and_is_refused_once_where_the_robot_cannot_move():
    r = ready()
    assert r.ask(intents.ReturnControl(user="ada")).ok
    r.run(0.05)
    r.teleop = TeleopTarget(sequence=1, hold=True, user="bob", base=BaseVelocity(0.1, 0.0))
    assert said(outputs(r, 0.1), ControlState)[-1].user == "bob"
    assert r.controller.mode == "TELEOP"
    r = ready()
    bridge_says(r, cutter="closing")
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    [refused] = [reason for reason in told(outputs(r, 0.3)) if reason.code == "teleoperation_refused"]
    assert severity_of(refused) == "warning" and "blades are closing" in text_of(refused)
    # What was held all the time moves nothing when the cut has ended: it must be released first.
    r.bridge_changes = {}
    r.run(0.3)
    assert r.controller.mode == "READY"
    r.teleop = TeleopTarget(sequence=1, hold=False, user="ada")
    r.run(0.05)
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    r.run(0.1)
    assert r.controller.mode == "TELEOP"


@pytest.mark.parametrize(("missing", "code"), [("server", "process_silent"), ("odometry", "odometry_stale")])
def test_a_hold_without_a_link_or_measurements_is_refused(missing, code):
    r = ready()
    r.deaf.add({"server": m.Heartbeat, "odometry": m.Odometry}[missing])
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    r.now += 1.0
    [refused] = [reason for reason in told(outputs(r, 0.1)) if reason.code == "teleoperation_refused"]
    assert dict(refused.values)["cause"].code == code and r.controller.mode == "READY"


def refusing(r, count):
    """The watchdog holds the robot, and so many commands have been refused."""
    refused = (RejectionCount(topic=topics.MOTION.name, reason=reasons.command_old(), count=count),)
    bridge_says(r, watchdog=True, rejections=refused)


def tokens(outs):
    return {token.token for token in said(outs, m.TokenRequest)}


def test_a_bridge_that_refuses_every_command_is_asked_for_another_token_after_two_seconds():
    r = ready()
    (first,) = tokens(outputs(r, 0.5))
    refusing(r, 1)
    assert tokens(outputs(r, 1.9)) == {first}
    outs = outputs(r, 0.3)
    assert [token.token for token in said(outs, m.TokenRequest) if token.releases] == [first]
    assert told(outs).count(reasons.commands_refused(2.0)) == 1
    (second,) = tokens(outputs(r, 1.0))
    assert second != first
    # It obeys again, and keeps the token.
    r.bridge_changes = {}
    assert tokens(outputs(r, 3.0)) == {second}


def test_a_watchdog_that_holds_the_robot_without_refusing_commands_changes_no_token():
    r = ready()
    (first,) = tokens(outputs(r, 0.5))
    refusing(r, 0)
    assert tokens(outputs(r, 5.0)) == {first}


def test_before_anything_was_measured_all_motion_is_refused():
    r = robot()
    answer = r.controller.answer(intents.Arm(user="ada", role="operator"), 0.0)
    assert not answer.ok and answer.reason == reasons.nothing_received(topics.JOINTS.name)


def test_at_the_start_nothing_was_interrupted():
    r = robot()
    r.step()
    assert r.state.interrupted == ""


def test_a_controller_without_a_bridge_is_silent_for_a_second():
    controller = robot().controller
    for now, waits in ((7.0, True), (7.9, True), (8.1, False)):
        controller.step(Inbox(), now)
        assert controller.waits == waits


def driven(r):
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    r.run(0.1)
    assert r.controller.mode == "TELEOP"


def test_a_protective_stop_says_why_and_what_it_interrupted_and_is_left_a_second_after_its_cause():
    r = ready()
    driven(r)
    r.frozen_sensors = True
    r.run(0.5)
    assert (r.state.mode, r.state.interrupted) == ("PROTECTIVE_STOP", "teleoperation")
    assert r.state.reason.code == "joints_stale"
    r.teleop = None
    r.run(2.0)
    assert r.ask(intents.Acknowledge(user="ada")).reason.code == "cause_remains"
    r.frozen_sensors = False
    r.run(0.5)
    assert r.ask(intents.Acknowledge(user="ada")).reason == reasons.cause_recent(1.0)
    r.run(0.7)
    assert r.ask(intents.Acknowledge(user="ada")).ok
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("PAUSED", "teleoperation")
    assert r.ask(intents.Resume(user="ada")).ok
    assert r.ask(intents.Home(user="ada")).ok
    r.run(0.1)
    r.frozen_sensors = True
    r.run(0.5)
    assert (r.state.mode, r.state.interrupted) == ("PROTECTIVE_STOP", "teleoperation")
    r.stop()
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("ESTOP_LATCHED", "")


def test_without_a_server_a_hand_moves_nothing_and_the_reason_is_told():
    r = ready()
    driven(r)
    r.server = False
    r.run(0.2)
    assert (r.state.mode, r.state.reason) == ("PAUSED", reasons.process_gone("server"))


def test_the_way_home_needs_measurements():
    r = on_the_way_home()
    r.frozen_sensors = True
    r.run(0.5)
    assert r.state.mode == "PROTECTIVE_STOP"


def test_a_ledger_that_takes_nothing_is_a_fault():
    r = ready()
    r.ledger = LedgerState(failure=reasons.ledger_failed("the disk is full"))
    r.run(0.1)
    assert (r.state.mode, r.state.reason) == ("FAULT", reasons.ledger_failed("the disk is full"))


def test_a_stop_that_only_the_bridge_knows_is_kept_with_its_time_and_reset_through_the_bridge():
    r = ready()
    r.inbox.wall_time = 1e9
    r.stop_id = "pressed-there"
    kept = said(outputs(r, 0.1), StopState)[-1].stops
    assert [(stop.stop_id, stop.source, stop.wall_time) for stop in kept] == [("pressed-there", "bridge", 1e9)]
    assert (r.state.mode, r.state.reason) == (
        "ESTOP_LATCHED",
        reasons.software_stop("ada", reasons.said("dog")),
    )
    assert r.ask(intents.Reset(user="ada", role="supervisor", reason="looked")).ok
    reset = reasons.mode_changed("ESTOP_LATCHED", "IDLE", reasons.stop_reset("ada", "looked"))
    assert reset in told(outputs(r, 0.2))
    assert r.state.mode == "IDLE"


def test_who_is_heard_keeps_control_and_at_rest_it_goes_over_at_once():
    r = ready()
    assert said(outputs(r, 3.0), ControlState)[-1].user == "ada"
    assert r.ask(intents.TakeControl(user="bob", confirm=True)).ok
    assert said(outputs(r, 0.1), ControlState)[-1].user == "bob"
