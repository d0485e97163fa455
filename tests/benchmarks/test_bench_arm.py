import json

import numpy as np
import pytest

from benchmarks.control import arm
from benchmarks.control.reach_run import Runner
from rolling_panda.model.robot import ARM_Q

RUNNER = Runner("hierarchy")


def test_pairs_repeat_are_inside_the_limits_and_clear():
    pairs = arm.draw(RUNNER, 3, 20)
    again = arm.draw(RUNNER, 3, 20)
    limits = RUNNER.robot.limits
    for pair, other in zip(pairs, again, strict=True):
        np.testing.assert_array_equal(pair.start, other.start)
        for posture in (pair.start, pair.goal):
            assert (posture > limits.lower[ARM_Q]).all() and (posture < limits.upper[ARM_Q]).all()
            q = np.zeros(12)
            q[ARM_Q] = posture
            assert RUNNER.collision.least(q).distance > 0.02
    assert not np.array_equal(pairs[0].start, pairs[1].start)


@pytest.mark.long
def test_the_arm_alone_reaches_and_ends_with_more_manipulability_than_it_has_to(tmp_path, capsys):
    path = tmp_path / "arm.json"
    assert arm.main(["--count", "12", "--seed", "3", "--jobs", "1", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "published" in printed and "hierarchy (here" in printed
    document = json.loads(path.read_text())
    summary, rows = document["summary"], document["results"]
    assert summary["failures"] <= 2 and summary["limits_broken"] == 0
    assert summary["omega_mean"] > summary["omega_start_mean"]
    for row in rows:
        assert row["quality"]["base_travel"] == 0.0
        assert row["omega_best"] >= 0.0
        if row["quality"]["reached"]:
            assert row["quality"]["duration"] > 0.1


@pytest.mark.parametrize("wrong", [["--count", "0"], ["--jobs", "0"], ["--method", "decoupled"]])
def test_wrong_arguments_are_refused(wrong):
    with pytest.raises(SystemExit) as end:
        arm.main(wrong)
    assert end.value.code == 2
