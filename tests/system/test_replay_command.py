"""`rolling-panda replay` with a server of its own: what a person or a script sees of a recording."""

import re
import subprocess
from pathlib import Path

import httpx
import pytest

from recorder.recording import RecordingWriter
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support import fake_wire
from tests.support.processes.local_router import free_port
from tests.support.running_server import answers, eventually

# The server takes half a minute to start on a busy machine.
pytestmark = [pytest.mark.alone, pytest.mark.slow]


def record(path: Path) -> None:
    """Ten seconds in which the base drives a metre; after three Ada accepts a point."""
    writer = RecordingWriter(path, "rp1")
    entry = m.QueueEntry(point_id="p1", state="ACCEPTED", user="ada")
    for k in range(500):
        at = 1_800_000_000_000_000_000 + k * 20_000_000
        writer.write(topics.JOINTS, fake_wire.joints(k + 1), at)
        writer.write(topics.ODOMETRY, fake_wire.odometry(k + 1, 0.002 * k), at)
        if k % 5 == 0:
            queue = (entry,) if k > 150 else ()
            writer.write(topics.BRIDGE, fake_wire.bridge_state(), at)
            writer.write(topics.CONTROLLER, fake_wire.controller_state(queue), at)
        if k % 50 == 0:
            writer.write(topics.POINTS, fake_wire.pruning_points(fake_wire.pruning_point()), at)
    writer.close()


def test_a_recording_is_shown_moved_in_and_asked_in_vain(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap")
    port = free_port()
    replay = subprocess.Popen(
        python_command("rolling_panda", ["replay", str(tmp_path / "a.mcap"), "--port", str(port)]),
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
    )
    try:
        assert replay.stdout is not None
        token = next(found[1] for line in replay.stdout if (found := re.search(r"token=(\S+)", line)))
        url = f"http://127.0.0.1:{port}"
        with httpx.Client(base_url=url, headers={"Origin": url}, timeout=60.0) as client:
            assert client.get("/sign-in").is_success, "the link can be opened as soon as it is told"
            eventually(lambda: answers(client), 120.0)
            client.post("/api/sign-in", json={"token": token}).raise_for_status()
            assert client.post("/api/replay", json={"position_s": 5.0, "playing": False}).json()["ok"]
            eventually(lambda: client.get("/api/state").json()["replay"]["position_s"] == 5.0)
            eventually(lambda: client.get("/api/state").json()["base"]["x"] == pytest.approx(0.5))
            eventually(lambda: len(client.get("/api/points").json()["points"]) == 1)
            state = client.get("/api/state").json()
            assert not state["replay"]["playing"]
            assert state["controller"]["mode"] == "READY"
            [row] = client.get("/api/points").json()["points"]
            assert (row["entry"]["state"], row["entry"]["user"]) == ("ACCEPTED", "ada")
            client.post("/api/replay", json={"position_s": 1.0, "playing": False})
            eventually(lambda: client.get("/api/points").json()["points"][0]["entry"]["state"] == "PROPOSED")
            refused = client.post("/api/arm", json={})
            assert refused.status_code == 409 and refused.json()["code"] == "recording_only"
    finally:
        replay.terminate()
        code = replay.wait(20)
        assert replay.stdout is not None
        replay.stdout.close()
    assert code == 0
