"""Faults between the real processes, judged by the trace; `rolling-panda bench faults --live` has all of them."""

import json
import math

import pytest

from benchmarks.faults.live_fault_kinds import LIVE_FAULTS
from benchmarks.faults.run import main

# Starts all processes, and each fault takes some seconds.
pytestmark = [pytest.mark.alone, pytest.mark.slow]


def test_every_hop_has_faults_and_each_says_what_it_tests():
    assert {"browser–server", "server–controller", "controller–bridge", "bridge–controller"} <= {
        fault.hop for fault in LIVE_FAULTS
    }
    assert len({fault.name for fault in LIVE_FAULTS}) == len(LIVE_FAULTS)


def test_drawn_faults_between_real_processes_hold(tmp_path):
    file = tmp_path / "live.json"
    assert main(["--live", "60", "--seed", "7", "--json", str(file)]) == 0
    document = json.loads(file.read_text())
    assert document["world"] == "real processes" and len(document["results"]) >= 5
    assert all(row["replayed"] == 0 and row["beyond"] == 0 for row in document["results"])
    timed = [row for row in document["results"] if row["quiet_s"] is not None and row["limit_s"] is not None]
    assert timed and all(math.isfinite(row["quiet_s"]) for row in timed)


def test_after_each_process_that_is_killed_the_next_trial_has_one_again(tmp_path):
    file = tmp_path / "live.json"
    assert main(["--live", "60", "--seed", "1", "--only", "killed", "--json", str(file)]) == 0
    happened = [row["fault"] for row in json.loads(file.read_text())["results"]]
    assert len(happened) >= 3 and "server killed" in happened
