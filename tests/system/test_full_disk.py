"""The disk of the running controller fills up in the middle of the work."""

import resource
from pathlib import Path

import pytest

from bridge.sim.robot import trace
from controller.ledger.check import verify
from tests.support.processes.live_robot import LiveRobot
from tests.system.test_lost_processes import drive

pytestmark = pytest.mark.alone


@pytest.mark.long
def test_a_full_disk_stops_the_robot_and_the_stop_still_works(tmp_path: Path) -> None:
    with LiveRobot(tmp_path) as robot:
        drive(robot)
        rows = verify(tmp_path / "state").rows
        assert rows > 0
        # No file of the controller may grow beyond this any more.
        resource.prlimit(robot.processes["controller"].pid, resource.RLIMIT_FSIZE, (4096, 4096))
        filled = robot.clock()
        refused = robot.client.post("/api/arm", json={})
        assert refused.status_code in (409, 503), refused.text
        robot.wait(lambda: robot.mode() == "FAULT", 5, "the fault")
        controller = robot.state()["controller"]
        assert controller["reason"]["code"] == "ledger_failed"
        assert robot.client.post("/api/start", json={}).status_code == 409
        assert robot.client.post("/api/stop", json={"reason": "disk full"}).status_code == 200
        robot.wait(lambda: robot.mode() == "ESTOP_LATCHED", 5, "the stop")
        whole = verify(tmp_path / "state")
        assert whole.problem == "" and whole.rows >= rows
        # All of this takes a quarter of a second, as braking does: the trace has to go on until the limit is over.
        robot.wait(lambda: robot.clock() > filled + 1.5, 5, "the robot to come to rest")
    assert trace.read(robot.trace).stopping_time(filled) < 1.0
