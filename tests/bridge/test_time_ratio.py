import pytest

from bridge.core.time_ratio import TimeRatio


def test_the_factor_is_robot_time_over_the_clock_of_the_last_second() -> None:
    pace = TimeRatio()
    assert pace.factor(0.0, 10.0) == 1.0
    for i in range(1, 100):
        slow = pace.factor(i * 0.025, 10.0 + i * 0.05)
    assert slow == pytest.approx(0.5)
    for i in range(1, 100):
        fast = pace.factor(99 * 0.025 + i * 0.05, 14.95 + i * 0.05)
    assert fast == pytest.approx(1.0)
