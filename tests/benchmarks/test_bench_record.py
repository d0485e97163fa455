"""What the measurement of the recorder makes of what it has seen."""

import math

import pytest

from benchmarks.control.record import LIMIT_S, Answers, percentile, summary
from rolling_panda import messages as m


def state(sequence: int) -> m.JointState:
    return m.JointState(header=m.Header(0.0), sequence=sequence, position=(0.0,) * 9, velocity=(0.0,) * 9)


def command(echo: int) -> m.MotionCommand:
    return m.MotionCommand(epoch=1, sequence=echo, echo=echo, xi=(0.0,) * 9)


def test_each_answer_counts_once_from_the_state_that_it_answers() -> None:
    answers = Answers()
    for sequence in range(1000):
        answers.on_joints(state(sequence), 0.01 * sequence)
    answers.on_motion(command(998), 9.983)
    answers.on_motion(command(998), 9.99)
    answers.on_motion(command(3), 9.99)
    assert answers.take() == pytest.approx([0.003]), "one twice, and one of a state long forgotten"
    assert answers.take() == []


def test_what_recording_adds_is_judged_by_the_percentile() -> None:
    assert percentile([0.001 * k for k in range(1, 101)], 0.99) == pytest.approx(0.099)
    assert math.isnan(percentile([], 0.5))
    without, slower = [0.002] * 100, [0.002] * 98 + [0.002 + 2 * LIMIT_S] * 2
    assert summary(without, without)["within"]
    found = summary(without, slower)
    assert not found["within"] and found["p99_added_s"] == pytest.approx(2 * LIMIT_S)
    assert not summary(without, [])["within"], "nothing was recorded"
