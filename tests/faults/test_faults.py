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
from benchmarks.faults.world import World
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import BaseVelocity

NAMED = {fault.name: fault for fault in FAULTS}
SHORT = ("software stop", "controller killed, base at full speed", "an older controller's commands")


@pytest.mark.parametrize("name", SHORT)
def test_the_most_important_ones_hold(name):
    trial = run_trial(NAMED[name], start(NAMED[name]), seed=5)
    assert trial.held, trial


def test_who_was_silent_and_has_lost_control_moves_the_robot_by_holding_anew():
    world = World(0)
    world._armed()
    world.heard = False
    world.run(1.5)
    assert world.controller._supervisor.authority.held is False
    world.heard, world.held = True, BaseVelocity(0.1, 0.0)
    world.modes.clear()
    world._until_it_moves(0.5)
    assert set(world.modes) == {"TELEOP"}


@pytest.mark.parametrize("held_by", ["a stop", "a fault of the robot"])
def test_a_robot_that_something_else_keeps_still_stays_under_its_token(held_by):
    world = World(0)
    world._armed()
    if held_by == "a stop":
        world.stop()
    else:
        plain = world.robot.read
        world.robot.read = lambda: replace(plain(), fault="the wheels say nothing")
    world.run(0.5)
    token = world.controller._supervisor.authority.token
    assert world.bridge._state(world.now).watchdog
    world.run(5.0)
    assert world.controller._supervisor.authority.token == token


def test_a_spoiled_number_that_was_accepted_does_not_keep_the_robot_still_for_good():
    world = World(0)
    world.drive()
    # A flipped bit far up in the number; all else is in order, so that the bridge believes it.
    world.bridge.on_motion(replace_field(world.commanded, sequence=world.commanded.sequence + 2**40), world.now)
    world.run(1.0)
    assert world.controller.mode == "PROTECTIVE_STOP" and abs(world.robot.now.velocity).max() < 1e-3
    world.held = None
    world.run(3.0)
    world.ask(intents.Acknowledge(user="ada"))
    world.ask(intents.Resume(user="ada"))
    world.run(0.5)
    assert abs(world.robot.now.velocity).max() < 1e-3, "nothing wakes by itself"
    world.held = BaseVelocity(0.1, 0.0)
    world._until_it_moves(0.5)


def test_who_was_overruled_by_another_controller_does_not_come_back_when_that_one_has_ended():
    world = World(0)
    world.drive()
    world.held = None
    world.run(1.0)
    newer = world.commanded.epoch + 1
    # It sends one command, at rest, and is gone.
    other = replace_field(world.commanded, epoch=newer, token="other", sequence=1, xi=(0.0,) * 9)
    assert not any(world.commanded.xi)
    late = world.commanded
    world.bridge.on_motion(other, world.now)
    for _ in range(20):
        # What was on its way still comes, and is refused.
        world.bridge.on_motion(late, world.now)
        world.run(0.5)
    assert world.controller.mode == "FAULT" and world.inputs.bridge.message.epoch == newer
    assert world.inputs.bridge.message.watchdog


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
