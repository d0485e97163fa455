import pytest
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.transport.runner import LoopClock

gaps = st.lists(st.floats(0.0, 10.0), max_size=30)


def test_a_loop_on_time_sees_ages_as_they_are() -> None:
    clock = LoopClock(100.0, 0.05)
    clock.turn(100.01)
    received = clock.of(100.013)
    for tick in range(2, 40):
        now = clock.turn(100.0 + 0.01 * tick)
    assert now - received == pytest.approx(100.39 - 100.013)


def test_the_loops_own_standstill_makes_nothing_old() -> None:
    clock = LoopClock(0.0, 0.05)
    received = clock.of(0.005)
    now = clock.turn(0.8)
    assert now - received == pytest.approx(0.045)
    # What came while it stood still has just come.
    assert now - clock.of(0.75) < 0.11


def test_a_loop_that_was_away_for_long_finds_things_old() -> None:
    clock = LoopClock(0.0, 0.05)
    received = clock.of(0.0)
    assert clock.turn(5.0) - received == pytest.approx(4.0)


def test_a_loop_that_is_always_slow_finds_things_nearly_as_old_as_they_are() -> None:
    clock, now = LoopClock(0.0, 0.05), 0.0
    for _ in range(40):
        now += 0.19
        time = clock.turn(now)
    received = clock.of(now)
    for _ in range(20):
        now += 0.19
        time = clock.turn(now)
    assert 0.7 * 3.8 < time - received <= 3.8


@given(gaps)
def test_it_never_goes_back_and_never_hurries(passed: list[float]) -> None:
    now, clock = 5.0, LoopClock(5.0, 0.05)
    before = clock.turn(now)
    for gap in passed:
        now += gap
        time = clock.turn(now)
        assert before <= time <= before + gap + 1e-9
        assert time >= before + min(gap, 0.05) - 1e-9
        before = time
