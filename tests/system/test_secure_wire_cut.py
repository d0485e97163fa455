"""Over mutual TLS, with nothing said that the router's access control does not allow, a point is found and cut."""

from pathlib import Path

import pytest

from bridge.sim.robot.trace import read
from rolling_panda import reasons
from rolling_panda.transport.certificates import make
from tests.support.processes.live_robot import LiveRobot

pytestmark = [pytest.mark.alone, pytest.mark.slow]


def test_a_point_is_cut_over_a_wire_with_certificates(tmp_path: Path) -> None:
    certificates = tmp_path / "certificates"
    make(certificates, ("127.0.0.1",), 2)
    with LiveRobot(tmp_path, certificates=certificates) as robot:
        assert robot.endpoint.startswith("tls/")
        robot.wait(lambda: len(robot.points()) >= 3, 60, "points to be found")
        robot.wait(lambda: robot.mode() == "IDLE", 30, "the controller to speak")
        robot.post("arm")
        chosen = sorted((row["point"] for row in robot.points()), key=lambda point: -point["confidence"])[:3]
        for point in chosen:
            robot.post(f"points/{point['point_id']}/accept", revision=point["revision"])

        def done() -> list[str]:
            """Points that are cut; who asks for the mode watches the robot, and lets it go on when it has paused.

            On a busy machine the pictures of what stands around can be too old to work by.
            """
            way = {"READY": "start", "PAUSED": "resume"}.get(robot.mode())
            if way is not None:
                robot.client.post(f"/api/{way}")
            return [row["point"]["point_id"] for row in robot.points() if row["entry"]["state"] == "DONE"]

        cut = robot.wait(done, 120, "a cut to be made")
        stop = robot.client.post("/api/stop", json={"reason": "end of the test"})
        assert stop.json()["reason"] == reasons.text_of(reasons.stop_confirmed())
        refused = [row["reason"]["code"] for row in robot.state()["bridge"]["rejections"]]
    cuts = [event for event in read(robot.trace).events if event["event"] == "cut"]
    assert any(made["point_id"] == cut[0] and made["severed"] for made in cuts), (cuts, refused)
