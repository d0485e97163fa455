"""Work in a copy of the process changes nothing here, and its failure is told."""

import pytest

from benchmarks.faults.forked_trials import apart
from rolling_panda.errors import RollingPandaError


def test_what_it_returns_comes_back_and_what_it_changes_does_not():
    kept = [1]

    def work():
        kept.append(2)
        return {"kept": len(kept), "never": float("inf")}

    assert apart(work) == {"kept": 2, "never": float("inf")}
    assert kept == [1]


def test_each_begins_from_the_same_start():
    numbers = iter(range(5))
    assert [apart(lambda: next(numbers)) for _ in range(3)] == [0, 0, 0]


def test_work_that_fails_is_told(capfd):
    with pytest.raises(RollingPandaError, match="child"):
        apart(lambda: 1 // 0)
    assert "ZeroDivisionError" in capfd.readouterr().err
