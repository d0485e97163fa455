"""Pictures of cuts, from the close-up to the report."""

import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.model.robot import RobotModel, configuration
from tests.support.fake_wire import ARM, HEADER, FakeWire, controller_state
from tests.support.played_server import camera_image
from tests.support.running_server import eventually, running_server


def close_up(sequence, image=None):
    k = Intrinsics(width=480, height=360, fx=400.0, fy=400.0, cx=239.5, cy=179.5)
    return m.CameraFrame(
        header=HEADER, sequence=sequence, intrinsics=k, base=m.PlanarPose(), position=(0.0, 0.0, *ARM),
        color_jpeg=camera_image() if image is None else image, depth_zlib=b"", depth_unit=1e-3, point_id="p1",
        number=sequence,
    )  # fmt: skip


def at(state, cut_id=""):
    """The controller's state: one point before the camera, in this state."""
    model = RobotModel()
    camera = model.pose(configuration(m.PlanarPose(), (0.0, 0.0, *ARM)), model.camera_id)
    place = tuple(float(x) for x in camera.translation + camera.rotation @ np.array([0.0, 0.0, 0.3]))
    return controller_state((m.QueueEntry("p1", state, cut_id=cut_id, accepted_position=place),))


def cut(wire, folder):
    """One cut, with a close-up before and after it."""
    wire.deliver(topics.CONTROLLER, at("ACCEPTED"))
    wire.deliver(topics.CAMERA, close_up(1))
    wire.deliver(topics.CONTROLLER, at("CUTTING", "c1"))
    eventually(lambda: (folder / "c1.before.jpg").exists())
    wire.deliver(topics.CAMERA, close_up(2))
    eventually(lambda: (folder / "c1.after.jpg").exists())
    wire.deliver(topics.CONTROLLER, at("DONE", "c1"))


@pytest.mark.long
def test_a_cut_has_its_pictures_also_after_a_restart_of_the_server(tmp_path):
    folder = tmp_path / "pictures" / "rp1"
    with running_server(wire := FakeWire(), state=tmp_path) as server, server.client(role="viewer") as client:
        wire.deliver(topics.CONTROLLER, at("ACCEPTED"))
        assert client.get("/api/cuts/c1/before.jpg").status_code == 204
        cut(wire, folder)
        with server.visitor() as stranger:
            assert stranger.get("/api/cuts/c1/before.jpg").status_code == 401
    with running_server(FakeWire(), state=tmp_path) as server, server.client(role="viewer") as client:
        for moment in ("before", "after"):
            answer = client.get(f"/api/cuts/c1/{moment}.jpg")
            assert (answer.status_code, answer.headers["content-type"]) == (200, "image/jpeg")
            assert answer.content == (folder / f"c1.{moment}.jpg").read_bytes()
        assert client.get("/api/cuts/c1/while.jpg").status_code == 422
        assert client.get("/api/cuts/..%2f..%2fledger/after.jpg").status_code in (404, 422)


@pytest.mark.long
def test_a_damaged_picture_is_left_out_and_logged_once(tmp_path):
    folder = tmp_path / "pictures" / "rp1"
    with running_server(wire := FakeWire(), state=tmp_path) as server, server.client() as client:
        cut(wire, folder)
        file = folder / "c1.after.jpg"
        file.write_bytes(file.read_bytes()[:500])
        for _ in range(3):
            assert client.get("/api/cuts/c1/after.jpg").status_code == 204
        codes = [each["reason"]["code"] for each in client.get("/api/events").json()["events"]]
        assert codes.count("cut_picture_damaged") == 1
        assert client.get("/api/cuts/c1/before.jpg").status_code == 200


@pytest.mark.long
def test_a_folder_that_cannot_be_written_costs_the_pictures_and_nothing_else(tmp_path):
    (tmp_path / "pictures").write_text("a file where the folder should be")
    with running_server(wire := FakeWire(), state=tmp_path) as server, server.client() as client:
        wire.deliver(topics.CONTROLLER, at("ACCEPTED"))
        for number in range(1, 4):
            wire.deliver(topics.CAMERA, close_up(2 * number))
            wire.deliver(topics.CONTROLLER, at("CUTTING", f"c{number}"))
            eventually(lambda: [e for e in events(client) if e["reason"]["code"] == "cut_picture_lost"])
        assert [each["reason"]["code"] for each in events(client)].count("cut_picture_lost") == 1
        assert client.get("/api/cuts/c1/before.jpg").status_code == 204
        assert client.get("/api/state").json()["controller"]["mode"] == "READY"


def events(client):
    return client.get("/api/events").json()["events"]


@pytest.mark.long
@pytest.mark.parametrize("image", [b"", b"\xff\xd8\xff no picture"])
def test_a_corrupt_camera_image_costs_its_picture_only(tmp_path, image):
    with running_server(wire := FakeWire(), state=tmp_path) as server, server.client() as client:
        wire.deliver(topics.CONTROLLER, at("ACCEPTED"))
        wire.deliver(topics.CAMERA, close_up(1, image))
        wire.deliver(topics.CONTROLLER, at("CUTTING", "c1"))
        eventually(lambda: "cut_picture_lost" in [each["reason"]["code"] for each in events(client)])
        wire.deliver(topics.CAMERA, close_up(2))
        eventually(lambda: client.get("/api/cuts/c1/after.jpg").status_code == 200)
