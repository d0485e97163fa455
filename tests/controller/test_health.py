from dataclasses import replace

import pytest

from controller.config import ControllerConfig
from controller.inputs import Inputs, Sample
from controller.supervision.health import FINE, Health, check, health
from rolling_panda import messages as m
from rolling_panda.messages.perception import Obstacles

CONFIG = ControllerConfig()
ALL = frozenset({"bridge", "controller", "perception", "server"})
HEALTHY = Health(0.01, 0.02, 0.05, 0.05, 0.05, ALL, watchdog=False, overruled=False)


def verdict(mode, moving=False, **changes):
    return check(mode, moving, replace(HEALTHY, **changes), CONFIG)


@pytest.mark.parametrize("mode", ["IDLE", "READY", "TELEOP", "AUTO", "PAUSED"])
def test_all_is_well(mode):
    assert verdict(mode) == FINE


@pytest.mark.parametrize("mode", ["AUTO", "TELEOP"])
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"joints": 0.21}, "joint states"),
        ({"odometry": 0.26}, "odometry"),
        ({"bridge": 0.6}, "bridge"),
        ({"joints": float("inf")}, "are endlessly old"),
        ({"watchdog": True}, "watchdog"),
    ],
)
def test_without_the_robots_own_data_motion_stops_protectively(mode, changes, words):
    found = verdict(mode, **changes)
    assert found.action == "protect"
    assert words in found.reason


@pytest.mark.parametrize(
    ("mode", "changes"),
    [
        ("TELEOP", {"server": 0.31}),
        ("AUTO", {"server": 2.01}),
        ("TELEOP", {"present": ALL - {"server"}}),
        ("AUTO", {"present": ALL - {"server"}}),
    ],
)
def test_without_the_server_motion_pauses(mode, changes):
    assert verdict(mode, **changes).action == "pause"
    assert "server" in verdict(mode, **changes).reason


@pytest.mark.parametrize("changes", [{"perception": 1.01}, {"present": ALL - {"perception"}}])
def test_without_perception_only_automatic_work_pauses(changes):
    assert verdict("AUTO", **changes).action == "pause"
    assert verdict("TELEOP", **changes) == FINE


def test_a_jitter_of_a_tenth_of_a_second_stops_nothing():
    jitter = {"joints": 0.11, "odometry": 0.12, "bridge": 0.15, "server": 0.15, "perception": 0.6}
    assert verdict("AUTO", **jitter) == FINE


def test_nothing_is_demanded_of_a_robot_that_does_not_move():
    gone = {"joints": 9.0, "server": 9.0, "present": frozenset()}
    assert verdict("READY", **gone) == FINE
    assert verdict("READY", moving=True, **gone).action == "protect"


def test_the_most_severe_of_several_counts():
    found = verdict("AUTO", present=frozenset(), joints=1.0, overruled=True)
    assert found.action == "fault"
    assert verdict("AUTO", present=frozenset(), joints=1.0).action == "protect"


def test_old_pictures_of_what_stands_around_stop_automatic_work_alone():
    old = verdict("AUTO", obstacles=6.5)
    assert old.action == "pause" and "with the obstacles is 6.50 s old" in old.reason
    assert verdict("TELEOP", obstacles=6.5) == FINE


def test_the_age_of_a_picture_is_told_by_its_stamp_however_often_it_is_repeated():
    def seen(stamp, at=100.0):
        joints = m.JointState(header=m.Header(50.0), sequence=1, position=(0.0,) * 9, velocity=(0.0,) * 9)
        told = Obstacles(header=m.Header(stamp), capsules=())
        return health(Inputs(joints=Sample(joints, 100.0), obstacles=Sample(told, at)), False, 100.0).obstacles

    assert seen(49.0) == 1.0
    assert seen(40.0) == 10.0
    assert seen(60.0) == 10.0, "a stamp from the future is as wrong"
    assert seen(50.0, at=90.0) == 10.0
    assert health(Inputs(), False, 0.0).obstacles == float("inf")


@pytest.mark.parametrize("mode", ["IDLE", "READY", "AUTO"])
def test_without_a_ledger_there_is_a_fault_in_every_mode(mode):
    found = verdict(mode, ledger="the disk is full")
    assert (found.action, found.reason) == ("fault", "the disk is full")


def test_a_robot_that_does_not_follow_is_stopped_protectively():
    found = verdict("AUTO", tracking_error="joint 3 does not follow")
    assert found.action == "protect" and "joint 3" in found.reason
