from dataclasses import replace

import pytest

from controller.config import ControllerConfig
from controller.safety import FINE, Health, check

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
        ({"joints": float("inf")}, "endlessly"),
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
