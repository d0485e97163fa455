"""What an operator asks of perception over REST."""

import pytest
from fake_wire import FakeWire, pruning_point, pruning_points
from running_server import eventually, running_server

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.crop_messages import PointCrop
from rolling_panda.errors import ServiceError
from rolling_panda.plant_requests import AddPoint, AddPointInImage, MovePoint, SetRule


@pytest.fixture(scope="module")
def running():
    with running_server(FakeWire()) as server:
        yield server


@pytest.fixture
def server(running):
    running.wire.asked.clear()
    running.wire.answer = lambda request: m.Answer(ok=True, reason="p9")
    return running


@pytest.mark.parametrize(
    ("path", "body", "request_"),
    [
        ("rule", {}, SetRule(user="ann")),
        (
            "rule",
            {"system": "guyot", "nodes_kept": 1, "fruiting_nodes": 10, "keeper_diameter": 0.007, "offset": 0.015},
            SetRule(
                user="ann",
                rule=m.PruningRule(
                    system="guyot", nodes_kept=1, fruiting_nodes=10, keeper_diameter=0.007, offset=0.015
                ),
            ),
        ),
        (
            "points/by-hand",
            {"origin": [0.0, -0.5, 1.0], "direction": [0.0, 1.0, 0.0]},
            AddPoint(user="ann", origin=(0.0, -0.5, 1.0), direction=(0.0, 1.0, 0.0)),
        ),
        ("points/p4/move", {"along": -0.005}, MovePoint(user="ann", point_id="p4", along=-0.005)),
        (
            "points/by-hand-in-image",
            {"sequence": 4, "u": 0.25, "v": 0.5},
            AddPointInImage(user="ann", sequence=4, u=0.25, v=0.5),
        ),
    ],
)
def test_each_request_goes_to_perception(server, path, body, request_):
    with server.client(user="ann") as client:
        answer = client.post(f"/api/{path}", json=body)
        assert (answer.status_code, answer.json()) == (200, {"ok": True, "reason": "p9"})
        assert server.wire.asked == [request_]
        events = client.get("/api/events").json()["events"]
        assert events[-1]["text"] == f"{type(request_).__name__} by ann: p9"


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("rule", {"nodes_kept": 0}),
        ("rule", {"nodes_kept": 2.5}),
        ("rule", {"system": "pergola"}),
        ("rule", {"offset": 0.5}),
        ("rule", {"more": 1}),
        ("points/p4/move", {"along": 0.5}),
        ("points/by-hand", {"origin": [0, 0], "direction": [0, 1, 0]}),
        ("points/by-hand-in-image", {"sequence": 1, "u": 1.2, "v": 0.5}),
    ],
)
def test_what_cannot_be_is_refused_before_it_is_asked(server, path, body):
    with server.client(user="ann") as client:
        assert client.post(f"/api/{path}", json=body).status_code == 422
    assert server.wire.asked == []


def test_a_viewer_may_not_ask_and_a_refusal_or_silence_is_told(server):
    with server.client(role="viewer", user="bob") as client:
        assert client.post("/api/rule", json={}).status_code == 403
    assert server.wire.asked == []
    with server.client(user="ann") as client:
        server.wire.answer = lambda request: m.Answer(ok=False, reason="no known cane there")
        answer = client.post("/api/points/by-hand", json={"origin": [0.0, 0.0, 1.0], "direction": [0.0, 1.0, 0.0]})
        assert (answer.status_code, answer.json()["reason"]) == (409, "no known cane there")

        def dead(request):
            raise ServiceError("service/plant did not answer within 2.0 s")

        server.wire.answer = dead
        assert client.post("/api/rule", json={}).status_code == 503


def test_the_picture_of_a_point_is_given_for_its_revision(server):
    with server.client(role="viewer", user="bob") as client:
        unknown = client.get("/api/points/p1/crop")
        assert (unknown.status_code, unknown.json()["reason"]) == (404, "there is no point 'p1'")
        server.wire.deliver(topics.POINTS, pruning_points(pruning_point("p1")))
        eventually(lambda: client.get("/api/points/p1/crop").status_code == 204)
        server.wire.deliver(topics.CROPS, PointCrop(point_id="p1", revision=3, sequence=7, jpeg=b"picture"))
        answer = client.get("/api/points/p1/crop?revision=3")
        assert (answer.content, answer.headers["content-type"]) == (b"picture", "image/jpeg")
        assert client.get("/api/points/p1/crop?revision=4").status_code == 204
        server.wire.deliver(topics.CROPS, PointCrop(point_id="p1", revision=4, sequence=9, jpeg=b"newer"))
        assert client.get("/api/points/p1/crop").content == b"newer"
    with server.visitor() as stranger:
        assert stranger.get("/api/points/p1/crop").status_code == 401
