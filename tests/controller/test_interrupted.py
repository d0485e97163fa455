"""What a pause has ended is told until something is begun again, so that the page can say which button goes on."""

import pytest

from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from tests.support.controller_at_work import robot, run_until, working
from tests.support.points import point


def at_work():
    r = working((point("p0", (0.5, 0.75, 1.05)),))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH", 10.0)
    return r


def surveying():
    r = robot()
    r.step()
    r.show((point("p0", (0.5, 0.75, 1.05)),))
    r.step()
    for intent in (intents.Arm(user="ada"), intents.Survey(user="ada", distance=2.0)):
        assert r.ask(intent).ok
    run_until(r, lambda s: s is not None and s.phase == "SURVEY", 10.0)
    return r


def led_by_hand():
    r = robot()
    r.run(0.05)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.05)
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.1, 0.0))
    run_until(r, lambda s: s.mode == "TELEOP", 2.0)
    return r


@pytest.mark.parametrize(("begun", "told"), [(at_work, "work"), (surveying, "survey"), (led_by_hand, "teleoperation")])
def test_what_was_paused_is_told_until_something_is_begun(begun, told):
    r = begun()
    assert r.state.interrupted == ""
    assert r.ask(intents.Pause(user="ada")).ok
    r.teleop = None
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("PAUSED", told)
    assert (r.state.phase, r.state.active_point_id) == ("", "")
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("READY", told)
    assert r.ask(intents.Survey(user="ada", distance=1.0)).ok
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("AUTO", "")


def test_one_command_goes_on_with_the_work_and_there_has_to_be_some():
    r = at_work()
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.ask(intents.Continue(user="ada")).ok
    r.run(0.1)
    assert (r.state.mode, r.state.interrupted) == ("AUTO", "")
    r = led_by_hand()
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.ask(intents.Continue(user="ada")).reason == reasons.nothing_interrupted()
    assert r.state.mode == "PAUSED"
    assert r.state.allowed["Continue"] == reasons.nothing_interrupted()


def test_a_pause_refuses_to_go_on_where_perception_is_gone():
    r = at_work()
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.state.allowed["Continue"] is None
    r.perception = False
    r.run(3.0)
    told = r.state.allowed["Continue"]
    assert told is not None and told.code in ("process_silent", "process_gone")
    assert r.ask(intents.Continue(user="ada")).reason == told and r.state.mode == "PAUSED"


def test_a_protective_stop_tells_it_through_its_acknowledgement_and_what_ended_by_itself_is_not_told():
    r = surveying()
    r.perception = False
    run_until(r, lambda s: s.mode != "AUTO", 20.0)
    assert (r.state.mode, r.state.interrupted) == ("PAUSED", "survey")
    r = led_by_hand()
    r.teleop = TeleopTarget(sequence=2, hold=False, user="ada")
    run_until(r, lambda s: s.mode == "READY", 5.0)
    assert r.state.interrupted == ""


def test_a_pause_ends_the_work_on_a_point_so_that_its_approach_can_be_turned():
    r = at_work()
    turned = intents.SetApproach(user="ada", point_id="p0", azimuth=0.3)
    assert r.ask(turned).reason.code == "point_worked_on"
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.1)
    assert r.ask(turned).ok
