"""Faults in full motion, judged by what the actuators were sent; `rolling-panda bench faults` has all of them."""

import math

import numpy as np
import pytest

from benchmarks.fault_world import MODEL
from benchmarks.faults import FAULTS, quiet_after, replays, run_trial, summary, violations
from bridge.sim.trace import ROW

NAMED = {fault.name: fault for fault in FAULTS}


def rows(*setpoints, epoch=1):
    out = np.zeros(len(setpoints), ROW)
    out["clock"] = 0.001 * np.arange(1, len(out) + 1)
    out["setpoint"][:, 2] = setpoints
    out["epoch"], out["sequence"] = epoch, np.arange(len(out))
    return out


def test_the_judge_sees_when_the_last_motion_was_sent():
    assert quiet_after(rows(0.1, 0.1, 0.0, 0.0), 0.0) == pytest.approx(0.003)
    assert quiet_after(rows(0.0, 0.0), 0.0) == 0.0
    assert quiet_after(rows(0.1, 0.0, 0.1), 0.0) == math.inf


def test_the_judge_sees_replays_and_older_tokens():
    assert replays(rows(0.0, 0.0, 0.0)) == 0
    old = rows(0.0, 0.0, 0.0)
    old["sequence"] = (4, 5, 3)
    assert replays(old) == 1
    old["epoch"], old["sequence"] = (2, 2, 1), (1, 2, 3)
    assert replays(old) == 1


def test_the_judge_sees_what_is_beyond_the_robots_limits():
    assert violations(rows(0.0, 0.0, 0.0)) == 0
    assert violations(rows(0.0, 1.0, 1.0)) > 0
    assert violations(rows(0.0, math.nan, 0.0)) > 0
    assert violations(rows(*np.full(5, float(MODEL.limits.velocity[2]) + 0.1))) > 0


@pytest.mark.parametrize("name", ["software stop", "controller killed", "an older controller's commands"])
def test_the_most_important_ones_hold(name):
    trial = run_trial(NAMED[name], seed=5)
    assert trial.held, trial


def test_the_summary_names_the_worst_and_counts_what_failed():
    good = run_trial(NAMED["software stop"], seed=6)
    found = summary([good])["R3"]
    assert found["n"] == 1 and found["held"] and 0.0 < found["worst_s"] <= found["limit_s"] == 0.2


#: What is not met, and by how much, is in docs/safety.md.
UNMET = {"release of the hold": "the base brakes at 1.5 m/s², for 0.2 s from its full speed"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fault, marks=pytest.mark.xfail(strict=True, reason=UNMET[fault.name]))
        if fault.name in UNMET
        else fault
        for fault in FAULTS
    ],
    ids=lambda fault: fault.name,
)
def test_every_fault_holds(fault):
    for seed in range(20):
        trial = run_trial(fault, seed)
        assert trial.held, trial
