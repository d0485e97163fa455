"""What the judge of faults sees in a trace, and what it does not take for well."""

import math

import numpy as np
import pytest

from benchmarks.faults.judge import Trial, braking_after, judge, last_taken, quiet_after, replays, summary, violations
from bridge.sim.robot.trace import ROW
from tests.support.worlds.faulty_world import MODEL


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


def test_the_judge_sees_when_braking_began_and_when_the_last_command_was_taken():
    driven = rows(*np.zeros(6))
    driven["setpoint"][:, 0] = (2.0, 2.0, 2.0, 1.9, 1.0, 0.0)
    assert braking_after(driven, 0.001) == pytest.approx(0.003)
    driven["setpoint"][-1, 0] = 2.0
    assert braking_after(driven, 0.001) == math.inf
    driven["sequence"] = (7, 8, 8, 9, 9, 9)
    assert last_taken(driven) == pytest.approx(0.003)


def test_a_robot_that_must_go_on_has_failed_when_it_rests():
    assert judge(rows(0.1, 0.1, 0.1), (), 0.0, math.inf)[3]
    assert not judge(rows(0.1, 0.1, 0.0), (), 0.0, math.inf)[3]
    for last in (0.0, 0.001):
        assert judge(rows(0.001, 0.001, last), (), 0.0, math.nan)[3]


def test_what_a_new_bridge_begins_with_is_no_jump_of_the_old_one():
    jump = rows(0.5, 0.5, 0.0, 0.0)
    assert judge(jump, (2,), 0.0, 0.01)[2] == 0 < judge(jump, (), 0.0, 0.01)[2]


def test_the_summary_names_the_worst_against_its_own_limit_and_counts_what_failed():
    good = Trial("a", "R3", 1, 0.2, "IDLE", 0.05, 0.1, 0, 0, True)
    near = Trial("b", "R3", 2, 0.5, "IDLE", 0.02, 0.3, 0, 0, True)
    never = Trial("c", "R3", 3, 0.5, "AUTO", math.inf, math.inf, 1, 0, False)
    found = summary([good, near])["R3"]
    assert (found["n"], found["held"], found["worst_s"], found["limit_s"]) == (2, True, 0.3, 0.5)
    assert (found["p99_s"], found["braking_p99_s"]) == (0.3, 0.05)
    found = summary([good, near, never])["R3"]
    assert (found["held"], found["failed"], found["worst_s"], found["replayed"]) == (False, 1, None, 1)
