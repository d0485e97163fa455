"""Work without a fault goes on, and a stop that there is would be seen; `rolling-panda bench clean` takes an hour."""

import json
from dataclasses import replace

import pytest

from benchmarks.faults.clean import EndlessRow, main, work


@pytest.mark.long
def test_work_goes_on_without_a_stop_and_with_jitter_on_the_ways(tmp_path, monkeypatch, capsys):
    # Calm and rough seconds in turns, so that a short run has both.
    monkeypatch.setattr("benchmarks.faults.clean._CALM_S", 2.0)
    file = tmp_path / "clean.json"
    assert main(["--seconds", "8", "--json", str(file)]) == 0
    found = json.loads(file.read_text())
    assert found["cuts"] >= 2 and found["stops"] == [] and found["longest_rest_s"] < 1.0
    assert "0 stops" in capsys.readouterr().out


@pytest.mark.long
def test_in_jitter_the_blades_are_asked_to_close_when_the_arm_rests():
    world = EndlessRow(0)
    world.motion.jitter = world.state.jitter = world.odometry.jitter = 0.1
    for _ in range(8):
        world.offer()
        world.run(1.0)
    assert world.controller.mode == "AUTO" and world.cut_ids
    refused = {each.reason.code: each.count for each in world.bridge.refusals.counts()}
    # An order is repeated twenty times a second until the blades close.
    assert refused.get("cut_in_motion", 0) <= 5


@pytest.mark.parametrize(
    ("fault", "mode"),
    [
        (lambda world: setattr(world, "perception", False), "PAUSED"),
        (lambda world: setattr(world.odometry, "loss", 1.0), "PROTECTIVE_STOP"),
    ],
)
def test_a_stop_is_told_once_with_its_time(fault, mode):
    world = EndlessRow(1)
    fault(world)
    found = replace(work(world, 3.0, 0.0), seconds=3.0)
    ((at, was),) = found.stops
    assert was == mode and 0.0 < at < 3.0 and found.longest_rest_s > 0.5
