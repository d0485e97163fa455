import pytest

from bridge.core.robot_faults import RobotFaults
from rolling_panda import reasons
from tests.support.fake_wire import as_received

STALE, REFLEX = reasons.base_silent("drives/joint_states"), reasons.arm_reflex("joint_reflex")


@pytest.fixture
def faults() -> RobotFaults:
    return RobotFaults()


def test_a_fault_is_told_once_when_it_begins_and_once_when_it_ends(faults: RobotFaults) -> None:
    assert faults.follow(None, False, False, 0.0) is None
    began = faults.follow(STALE, False, False, 1.0)
    assert began is not None
    assert began.told == reasons.robot_faulty(STALE) and began.stop is None
    assert faults.follow(STALE, False, False, 2.0) is None
    ended = faults.follow(None, False, False, 3.0)
    assert ended is not None and ended.told == reasons.robot_ready_again()


def test_a_severe_fault_latches_a_stop_that_says_why(faults: RobotFaults) -> None:
    change = faults.follow(REFLEX, True, False, 1.0)
    assert change is not None and change.stop is not None
    assert (change.stop.reason, change.stop.source, change.stop.user) == (REFLEX, "robot", "")
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


def test_a_stop_with_a_long_reason_is_one_that_the_wire_carries(faults: RobotFaults) -> None:
    change = faults.follow(reasons.device_fault("arm", "x" * 600), True, False, 1.0)
    assert change is not None and change.stop is not None
    assert as_received(change.stop).reason == reasons.device_fault("arm", "x" * 500)


def test_releases_are_counted(faults: RobotFaults) -> None:
    for count in (1, 2, 3):
        faults.released(count * 1.0)
        assert faults.releases == count
