"""A process that dies in motion: the simulated actuators come to rest in time, and what remains says what has gone."""

from functools import partial
from pathlib import Path

import pytest

from bridge.sim.robot import trace
from tests.support.processes.live_robot import LiveRobot

pytestmark = pytest.mark.alone

#: From the kill until base and arm are still (s).
LIMIT_S = 0.4


def drive(robot: LiveRobot) -> None:
    """Accept the point farthest along the row that can be reached, and wait until the base drives to it."""
    robot.wait(lambda: len(robot.points()) >= 3, 60, "points")
    robot.post("arm")
    robot.wait(lambda: robot.mode() == "READY", 20, "READY")
    points = [row["point"] for row in robot.points()]
    for point in sorted(points, key=lambda point: float(point["position"][0]), reverse=True):
        robot.post(f"points/{point['point_id']}/accept", revision=point["revision"])
        # Refused where the plan was quicker to find that the point cannot be reached.
        robot.client.post("/api/start", json={})
        robot.wait(partial(decided, robot, point["point_id"]), 40, "the base to drive")
        if not unreached(robot, point["point_id"]):
            return
        robot.wait(lambda: robot.mode() == "READY", 20, "READY")
    raise AssertionError("no point can be reached")


def decided(robot: LiveRobot, name: str) -> bool:
    """Whether the base drives to a point, or it turned out to be out of reach."""
    return robot.driving() or unreached(robot, name)


def unreached(robot: LiveRobot, name: str) -> bool:
    """Whether a point turned out to be out of reach."""
    entries = {row["entry"]["point_id"]: row["entry"] for row in robot.points()}
    return entries[name]["state"] in ("UNREACHABLE", "FAILED_NOT_CUT")


# Each a start of everything; the one after which most could go wrong, the controller's, is below and not slow.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["router", "perception", "server"])
def test_base_and_arm_are_still_soon_after_a_process_is_killed(tmp_path: Path, name: str) -> None:
    with LiveRobot(tmp_path) as robot:
        drive(robot)
        killed = robot.kill(name)
        if name == "perception":
            robot.wait(lambda: robot.gone(name), 5, "the server to say that perception has gone")
        robot.wait(lambda: robot.clock() > killed + 1.5, 5, "the robot to come to rest")
    assert trace.read(robot.trace).stopping_time(killed) < LIMIT_S


@pytest.mark.long
def test_a_killed_controller_is_missed_and_a_new_one_moves_nothing_by_itself(tmp_path: Path) -> None:
    with LiveRobot(tmp_path) as robot:
        drive(robot)
        killed = robot.kill("controller")
        row = robot.wait(lambda: robot.gone("controller"), 5, "the server to say that the controller has gone")
        # The last state stays, with its age, instead of vanishing.
        assert row["age_s"] is not None
        assert robot.state()["controller"] is not None
        robot.start("controller")
        robot.wait(lambda: robot.mode() in ("IDLE", "READY") and not robot.gone("controller"), 20, "the new controller")
        robot.wait(lambda: robot.clock() > killed + 6.0, 10, "time to pass")
        assert robot.mode() == "IDLE"
        # What was accepted still is, and waits for somebody to arm and start.
        states = {row["entry"]["state"] for row in robot.points()}
        assert "ACCEPTED" in states and states <= {"ACCEPTED", "UNREACHABLE", "PROPOSED"}
    assert trace.read(robot.trace).stopping_time(killed) < LIMIT_S


@pytest.mark.long
def test_the_server_says_that_the_bridge_has_gone_and_keeps_its_last_state(tmp_path: Path) -> None:
    with LiveRobot(tmp_path) as robot:
        drive(robot)
        robot.kill("bridge")
        robot.wait(lambda: robot.gone("bridge"), 5, "the server to say that the bridge has gone")
        robot.wait(lambda: robot.mode() in ("PAUSED", "PROTECTIVE_STOP", "FAULT"), 5, "the controller to stop")
        state = robot.state()
        assert state["bridge"] is not None and state["joints"] is not None
        assert state["bridge_age_s"] > 0.1
        refused = robot.client.post("/api/start", json={})
        assert refused.status_code == 409
        assert refused.json()["reason"]
