import pytest

from bridge.core.robot_time import RealTime, RobotTime, SteppedTime, TimeRatio


def pass_time(time: RobotTime, clock: float, seconds: float) -> list[float]:
    """Wake every 5 ms for a while; the times of all steps."""
    times = []
    for wake in range(1, round(seconds / 0.005) + 1):
        times += [time.tick() for _ in range(time.due(clock + wake * 0.005))]
    return times


@pytest.mark.parametrize("kind", [SteppedTime, RealTime])
def test_a_second_has_a_thousand_steps_and_each_is_later_than_the_last(kind: type[SteppedTime | RealTime]) -> None:
    times = pass_time(kind(100.0, 0.001), 100.0, 1.0)
    assert len(times) == pytest.approx(1000, abs=1)
    assert all(b > a for a, b in zip(times, times[1:], strict=False))
    assert times[-1] == pytest.approx(101.0, abs=0.002)


def test_a_simulated_robot_loses_the_time_that_its_process_stood_still() -> None:
    time = SteppedTime(7.0, 0.001)
    pass_time(time, 7.0, 1.0)
    assert time.due(13.0) == 20
    pass_time(time, 13.0, 1.0)
    assert time.now == pytest.approx(9.02, abs=0.005)
    assert time.due(13.5) == 0, "it does not hurry"


@pytest.mark.parametrize("kind", [SteppedTime, RealTime])
def test_no_step_is_due_before_its_time(kind: type[SteppedTime | RealTime]) -> None:
    time = kind(100.0, 0.001)
    assert time.now == 100.0
    assert time.due(100.0) == time.due(100.0009) == 0
    assert time.due(100.0101) == 10
    for _ in range(10):
        time.tick()
    assert time.due(100.0102) == 0


def test_steps_of_a_real_robot_that_fall_on_the_time_are_due() -> None:
    time = RealTime(0.0, 0.001)
    for wake in range(1, 1000):
        assert time.due(wake * 0.001) == 1, wake
        time.tick()


def test_a_real_robots_first_step_after_a_standstill_knows_how_long_it_was() -> None:
    time = RealTime(0.0, 0.001)
    pass_time(time, 0.0, 1.0)
    due = time.due(6.0)
    assert due == 20
    # What arrived meanwhile is judged by the present time, before the first step.
    assert time.now == pytest.approx(5.98, abs=0.002)
    assert time.tick() >= 5.97
    assert [time.tick() for _ in range(due - 1)][-1] == pytest.approx(6.0, abs=0.002)
    assert len(pass_time(time, 6.0, 1.0)) == pytest.approx(1000, abs=1)


def test_the_factor_is_robot_time_over_the_clock_of_the_last_second() -> None:
    pace = TimeRatio()
    assert pace.factor(0.0, 10.0) == 1.0
    for i in range(1, 100):
        slow = pace.factor(i * 0.025, 10.0 + i * 0.05)
    assert slow == pytest.approx(0.5)
    for i in range(1, 100):
        fast = pace.factor(99 * 0.025 + i * 0.05, 14.95 + i * 0.05)
    assert fast == pytest.approx(1.0)


def test_the_factor_compares_with_what_was_a_second_ago_or_as_little_more_as_there_is() -> None:
    pace = TimeRatio()
    samples = ((0.0, 0.0), (0.25, 0.5), (2.0, 2.0), (3.0, 4.0))
    assert [pace.factor(*sample) for sample in samples] == [1.0, 0.5, pytest.approx(1.75 / 1.5), 0.5]
    pace = TimeRatio()
    told = [pace.factor(0.0 if k < 5 else 1.0, 0.25 * k) for k in range(10)]
    assert told == [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]
