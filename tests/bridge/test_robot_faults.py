import pytest

from bridge.core.robot_faults import RobotFaults

STALE, REFLEX = "base: no wheel speeds", "arm: reflex"


@pytest.fixture
def faults() -> RobotFaults:
    return RobotFaults()


def test_a_fault_is_told_once_when_it_begins_and_once_when_it_ends(faults: RobotFaults) -> None:
    assert faults.follow("", False, False, 0.0) is None
    began = faults.follow(STALE, False, False, 1.0)
    assert began is not None
    assert STALE in began.text and began.stop is None
    assert faults.follow(STALE, False, False, 2.0) is None
    ended = faults.follow("", False, False, 3.0)
    assert ended is not None and "ready again" in ended.text


def test_a_severe_fault_latches_a_stop_that_says_why(faults: RobotFaults) -> None:
    change = faults.follow(REFLEX, True, False, 1.0)
    assert change is not None and change.stop is not None
    assert (change.stop.reason, change.stop.source) == (REFLEX, "robot")
    assert faults.follow(REFLEX, True, True, 2.0) is None


def test_it_is_not_latched_anew_while_the_robot_recovers_but_when_it_has_not(faults: RobotFaults) -> None:
    first = faults.follow(REFLEX, True, False, 1.0)
    faults.released(2.0)
    assert faults.releases == 1
    assert faults.follow(REFLEX, True, False, 3.0) is None
    again = faults.follow(REFLEX, True, False, 5.5)
    assert first is not None and first.stop is not None
    assert again is not None and again.stop is not None
    assert again.stop.stop_id != first.stop.stop_id, "a released id never latches again"


def test_a_fault_during_a_stop_latches_when_that_stop_is_released(faults: RobotFaults) -> None:
    change = faults.follow(REFLEX, True, True, 1.0)
    assert change is not None and change.stop is None
    again = faults.follow(REFLEX, True, False, 2.0)
    assert again is not None and again.stop is not None
