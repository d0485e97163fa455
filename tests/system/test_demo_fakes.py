"""The main job by the real robot's drivers: every device a fake beside the simulated row, in a process of its own."""

import math
from pathlib import Path
from typing import Any

import pytest

from bridge.sim.robot import trace
from rolling_panda.resources import resource
from tests.support.extras import need
from tests.support.processes.demo import Demo
from tests.support.processes.local_router import free_port

need("real")

# Eight processes for minutes, half of them at a kilohertz.
pytestmark = [pytest.mark.alone, pytest.mark.slow]

ADDRESS = "127.0.0.43"


def entries(demo: Demo) -> dict[str, dict[str, Any]]:
    return {row["entry"]["point_id"]: row["entry"] for row in demo.client.get("/api/points").json()["points"]}


def ended(demo: Demo) -> bool:
    """Whether one is cut, or the work has stopped; work that was paused for a late picture is taken up again."""
    if "DONE" in {entry["state"] for entry in entries(demo).values()}:
        return True
    if demo.in_mode("PAUSED"):
        demo.client.post("/api/resume", json={})
    elif demo.in_mode("READY"):
        demo.client.post("/api/start", json={})
    return not (demo.in_mode("AUTO") or demo.in_mode("READY") or demo.in_mode("PAUSED"))


def test_an_accepted_point_is_cut_where_it_was_accepted_by_libfranka_ros_and_librealsense(tmp_path: Path) -> None:
    config, record = tmp_path / "fakes.toml", tmp_path / "trace"
    text = resource("assets/config/fakes.toml").read_text().replace("127.0.0.41", ADDRESS)
    # Two cores that other tests use too may take seconds for a picture, which is nothing against the drivers. These are
    # the longest that may be configured, and what is paused for longer is taken up again.
    patient = (
        "[controller.supervision]\nobstacles_max_age_s = 10.0\nperception_max_age_s = 2.0\n\n"
        "[controller.work]\nclose_up_timeout_s = 20.0\n\n"
        "[perception]\nframe_timeout_s = 20.0"
    )
    small = "[vineyard]\nvines = 1\nrows_behind = 0\n\n"
    felt = text.replace("[bridge]\n", "[bridge]\ninertial = true\n")
    config.write_text(felt.replace("[perception]", small + patient))
    demo = Demo(free_port(), 0, config, "--bridge", "real", "--fakes", "--trace", str(record))
    try:
        assert demo.state()["bridge"]["kind"] == "fakes"
        demo.post("arm")
        demo.wait(lambda: demo.in_mode("READY"), 20.0)
        demo.post("points/accept-all", confidence=0.0)
        # The network takes its time on a busy machine, and nobody starts on an old picture.
        demo.wait(lambda: demo.client.post("/api/start", json={}).json()["ok"], 60.0)
        with demo.watched():
            demo.wait(lambda: demo.in_mode("AUTO"), 10.0)
            demo.wait(lambda: ended(demo), 200.0)
        assert "DONE" in {entry["state"] for entry in entries(demo).values()}, entries(demo)
        done = [entry["accepted_position"] for entry in entries(demo).values() if entry["state"] == "DONE"]
    finally:
        demo.close()
    severed = [
        piece["point"] for event in trace.read(record).events if event["event"] == "cut" for piece in event["severed"]
    ]
    for accepted in done:
        assert min(math.dist(accepted, point) for point in severed) < 0.010
