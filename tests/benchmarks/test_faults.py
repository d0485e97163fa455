"""Faults in full motion, judged by what the actuators were sent; `rolling-panda bench faults` has all of them."""

import json
from collections import Counter
from dataclasses import replace
from functools import partial

import pytest
from msgspec.structs import replace as replace_field

from benchmarks.faults.forked_trials import apart
from benchmarks.faults.kinds import FAULTS
from benchmarks.faults.run import deal, main, run_trial, start
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import BaseVelocity
from tests.support.worlds.faulty_world import FaultyWorld
from tests.support.worlds.world import RecordedController

NAMED = {fault.name: fault for fault in FAULTS}
SHORT = ("software stop", "controller killed, base at full speed", "an older controller's commands")


@pytest.mark.parametrize("name", SHORT)
def test_the_most_important_ones_hold(name):
    trial = run_trial(NAMED[name], start(NAMED[name]), seed=5)
    assert trial.held, trial


def bridge_state(world):
    """What the bridge has told last."""
    return world.inbox.newest(m.BridgeState).message


def test_who_was_silent_and_has_lost_control_moves_the_robot_by_holding_anew():
    world = FaultyWorld(0)
    world.arm()
    world.heard = False
    world.run(1.5)
    assert world.lease.holder == ""
    world.heard, world.held = True, BaseVelocity(0.1, 0.0)
    world.modes.clear()
    world.until_it_moves(0.5)
    assert set(world.modes) == {"TELEOP"}


@pytest.mark.parametrize("held_by", ["a stop", "a fault of the robot"])
def test_a_robot_that_something_else_keeps_still_stays_under_its_token(held_by):
    world = FaultyWorld(0)
    world.arm()
    if held_by == "a stop":
        world.stop()
    else:
        plain = world.robot.read
        world.robot.read = lambda: replace(plain(), fault="the wheels say nothing")
    world.run(0.5)
    before = bridge_state(world)
    assert before.holder and before.watchdog
    world.run(5.0)
    assert (bridge_state(world).holder, bridge_state(world).epoch) == (before.holder, before.epoch)


def test_a_spoiled_number_that_was_accepted_does_not_keep_the_robot_still_for_good():
    world = FaultyWorld(0)
    world.drive()
    # A flipped bit far up in the number; all else is in order, so that the bridge believes it.
    world.bridge.on_motion(replace_field(world.commanded, sequence=world.commanded.sequence + 2**40), world.now)
    world.run(1.0)
    assert world.controller.mode == "PROTECTIVE_STOP" and abs(world.robot.now.velocity).max() < 1e-3
    world.held = None
    world.run(3.0)
    world.command(intents.Acknowledge(user="ada"))
    world.command(intents.Resume(user="ada"))
    world.run(0.5)
    assert abs(world.robot.now.velocity).max() < 1e-3, "nothing wakes by itself"
    world.held = BaseVelocity(0.1, 0.0)
    world.until_it_moves(0.5)


def test_who_was_overruled_gets_the_token_back_when_the_other_has_ended_and_its_fault_can_be_acknowledged():
    world = FaultyWorld(0)
    world.drive()
    world.held = None
    world.run(1.0)
    epoch = bridge_state(world).epoch
    # It is silent for long enough for another one to get the token, which is gone at once.
    world.alive = False
    world.run(1.2)
    world.bridge.on_token(m.TokenRequest(token="other", echo=world.ticks // 10, mode="IDLE"), world.now)
    world.alive = True
    world.run(0.5)
    assert world.controller.mode == "FAULT" and world.controller.waits
    for _ in range(20):
        # What was on its way still comes, and is refused.
        world.bridge.on_motion(world.commanded, world.now)
        world.run(0.2)
        assert abs(world.robot.now.velocity).max() < 1e-3
    assert not world.controller.waits and bridge_state(world).epoch == epoch + 2
    world.command(intents.Acknowledge(user="ada", role="supervisor"))
    assert world.controller.mode == "IDLE"


def second_controller(world):
    """Another controller that hears and is heard as the first one; returns its core and its process."""
    other = world.new_controller()
    return other, world.add("controller", RecordedController(other), 1.0 / world.config.rate_hz, 5.0)


def test_a_second_controller_waits_while_the_first_works_and_takes_over_when_that_one_is_gone():
    world = FaultyWorld(0)
    world.drive()
    other, process = second_controller(world)
    world.modes.clear()
    world.run(3.0)
    assert set(world.modes) == {"TELEOP"} and abs(world.robot.now.velocity[:2]).min() > 0.5
    assert other.waits and other.mode == "IDLE"
    assert "token_held" in {row.reason.code for row in world.bridge.refusals.counts() if row.topic == "command/token"}
    assert not other.answer(intents.Arm(user="eve", role="supervisor"), world.now).ok
    epoch = world.commanded.epoch
    world.alive = False
    world.run(1.4)
    assert not other.waits and process.runner.inbox.newest(m.BridgeState).message.epoch == epoch + 1
    assert abs(world.robot.now.velocity).max() < 1e-3


def test_a_second_controller_does_not_put_the_first_into_a_fault_that_stays():
    world = FaultyWorld(0)
    world.arm()
    other, process = second_controller(world)
    # The first one hangs for so long that the second takes over, and goes on.
    world.alive = False
    world.run(2.0)
    world.alive = True
    world.run(1.0)
    assert world.controller.mode == "FAULT" and world.controller.waits and not other.waits
    process.suspended = True
    world.say(other.end()[0])
    world.run(2.0)
    assert not world.controller.waits
    world.command(intents.Acknowledge(user="ada", role="supervisor"))
    assert world.controller.mode == "IDLE"


@pytest.mark.parametrize("mode", ["IDLE", "TELEOP"])
def test_commands_by_somebody_else_under_the_robots_own_token_are_seen_stopped_and_told(mode):
    world = FaultyWorld(0)
    if mode == "IDLE":
        world.run(0.5)
    else:
        world.drive()
        world.held = None
    world.intruder, said, step = partial(thief, world.commanded), [], world.bridge.step
    world.bridge.step = lambda *now: (out := step(*now), said.extend(event.reason for event in out.events))[0]
    before = world.robot.now.position
    world.run(1.0)
    assert world.controller.mode == "ESTOP_LATCHED" and abs(world.robot.now.velocity).max() < 1e-3
    assert bridge_state(world).stopped_by == reasons.software_stop("controller", reasons.foreign_motion())
    assert 0.05 < abs(world.robot.now.position - before).max() < 1.0
    told = [reason for reason in said if reason.code in ("moved_in_mode", "moved_without_mode")]
    assert told == ([reasons.moved_in_mode("IDLE")] if mode == "IDLE" else [])
    # The token that is known to others is worth nothing any more.
    stop_id = bridge_state(world).stop_id
    world.people = ("ada",)
    world.run(0.3)
    world.command(intents.Reset(user="ada", role="supervisor", reason="looked", stop_id=stop_id))
    world.run(2.0)
    assert bridge_state(world).stop_id == ""
    assert world.controller.mode == "IDLE" and abs(world.robot.now.velocity).max() < 1e-3
    world.intruder = lambda world: None
    world.run(0.5)
    world.arm()


def thief(stolen, world):
    """Has heard a command with its token, and turns the arm by it."""
    if world.ticks % 10 == 5:
        xi = (0.0, 0.0, 1.0, *(0.0,) * 6)
        number = 2**40 + world.ticks
        world.bridge.on_motion(replace_field(stolen, sequence=number, echo=world.ticks // 10, xi=xi), world.now)


def test_trials_are_dealt_out_to_the_faults_of_a_requirement_each_with_a_seed_of_its_own():
    count, seeds = Counter(), []
    for fault, those in deal(FAULTS, seed=7, trials=10):
        count[fault.requirement] += len(those)
        seeds += those
    assert set(count.values()) == {10} and {fault.requirement for fault in FAULTS} == set(count)
    assert len(set(seeds)) == len(seeds)


def test_a_fault_that_is_not_survived_in_time_is_told_and_counted(tmp_path, monkeypatch, capsys):
    # With a limit that nothing can keep, the same stop is a failure.
    strict = replace(NAMED["software stop in automatic work"], limit_s=0.001)
    monkeypatch.setattr("benchmarks.faults.run.FAULTS", (strict,))
    file = tmp_path / "faults.json"
    assert main(["--seed", "4", "--trials", "1", "--json", str(file)]) == 1
    document = json.loads(file.read_text())
    summary, (row,) = document["summary"]["R3"], document["results"]
    assert summary["n"] == 1 and not summary["held"] and summary["worst_s"] > summary["limit_s"] == 0.001
    assert row["fault"] == strict.name and row["quiet_s"] == pytest.approx(summary["worst_s"])
    assert "NOT HELD" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_holds(fault):
    world = start(fault)
    for seed in range(20):
        trial = apart(partial(run_trial, fault, world, seed))
        assert trial.held, trial
