"""What an operator asks of perception over REST."""

import pytest

from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.commands import (
    AddPoint,
    AddPointInImage,
    EvaluateRule,
    LeaveSite,
    MovePoint,
    RestoreAccepted,
    SetRule,
    UndoRule,
)
from rolling_panda.errors import ServiceError
from rolling_panda.messages.perception import DrawnCut, SpurDrawing, SpurPicture
from rolling_panda.reasons import said, text_of
from server.api.responses import outcome
from server.robots.pictures import PictureStore
from tests.support.fake_wire import FakeWire, controller_state, pruning_point, pruning_points
from tests.support.running_server import eventually, running_server

PLACED = reasons.point_placed("p9")


@pytest.fixture(scope="module")
def running():
    with running_server(FakeWire()) as server:
        yield server


@pytest.fixture
def server(running):
    running.wire.asked.clear()
    running.wire.answer = lambda request: m.Answer(ok=True, reason=PLACED)
    return running


@pytest.mark.parametrize(
    ("path", "body", "request_"),
    [
        ("rule", {}, SetRule(user="ann")),
        (
            "rule",
            {"system": "guyot", "nodes_kept": 1, "fruiting_nodes": 10, "preferred_diameter": 0.007, "offset": 0.015},
            SetRule(
                user="ann",
                rule=m.PruningRule(
                    system="guyot", nodes_kept=1, fruiting_nodes=10, preferred_diameter=0.007, offset=0.015
                ),
            ),
        ),
        (
            "points/by-hand",
            {"origin": [0.0, -0.5, 1.0], "direction": [0.0, 1.0, 0.0]},
            AddPoint(user="ann", origin=(0.0, -0.5, 1.0), direction=(0.0, 1.0, 0.0)),
        ),
        ("sites/leave", {"vine": 2, "spur": 3}, LeaveSite(user="ann", vine=2, spur=3)),
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
        assert (answer.status_code, answer.json()) == (200, outcome(True, PLACED))
        assert server.wire.asked == [request_]
        events = client.get("/api/events").json()["events"]
        assert events[-1]["text"] == f"{type(request_).__name__} by ann: {text_of(PLACED)}"


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("rule", {"nodes_kept": 0}),
        ("rule", {"nodes_kept": 2.5}),
        ("rule", {"system": "pergola"}),
        ("rule", {"offset": 0.5}),
        ("rule", {"more": 1}),
        ("rule/what-if", {"nodes_kept": 0}),
        ("rule/undo", {"system": "pergola"}),
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
        for path in ("rule", "rule/what-if", "rule/undo"):
            assert client.post(f"/api/{path}", json={}).status_code == 403
    assert server.wire.asked == []
    with server.client(user="ann") as client:
        server.wire.answer = lambda request: m.Answer(ok=False, reason=said("no known cane there"))
        answer = client.post("/api/points/by-hand", json={"origin": [0.0, 0.0, 1.0], "direction": [0.0, 1.0, 0.0]})
        assert (answer.status_code, answer.json()["reason"]) == (409, "no known cane there")

        def dead(request):
            raise ServiceError("service/plant did not answer within 2.0 s")

        server.wire.answer = dead
        assert client.post("/api/rule", json={}).status_code == 503


EFFECT = m.RuleEffect(changed=("r1", "r2", "r3"), removed=("r4",), added=2)


def queue_of(server, **states):
    server.wire.deliver(topics.POINTS, pruning_points(*(pruning_point(name) for name in states)))
    queue = tuple(m.QueueEntry(name, state) for name, state in states.items())
    server.wire.deliver(topics.CONTROLLER, controller_state(queue))


def test_what_a_rule_would_change_is_told_with_the_acceptances_and_nothing_is_logged(server):
    with server.client(user="ann") as client:
        queue_of(server, r1="ACCEPTED", r2="UNREACHABLE", r3="PROPOSED", r4="ACCEPTED", r5="ACCEPTED")
        eventually(lambda: len(client.get("/api/points").json()["points"]) == 5)
        server.wire.answer = lambda request: m.Answer(ok=True, reason=said("7 points"), effect=EFFECT)
        events = len(client.get("/api/events").json()["events"])
        answer = client.post("/api/rule/what-if", json={"nodes_kept": 3})
        assert (answer.status_code, answer.json()) == (
            200,
            {
                "ok": True,
                "reason": text_of(reasons.rule_effect(3, 1, 2, 3)),
                "code": "rule_effect",
                "values": {"changed": 3.0, "removed": 1.0, "added": 2.0, "voided": 3.0},
                "changed": 3,
                "removed": 1,
                "added": 2,
                "voided": 3,
            },
        )
        assert server.wire.asked == [EvaluateRule(user="ann", rule=m.PruningRule(nodes_kept=3))]
        assert len(client.get("/api/events").json()["events"]) == events
        server.wire.answer = lambda request: m.Answer(ok=True, effect=m.RuleEffect())
        assert client.post("/api/rule/what-if", json={}).json()["code"] == "rule_without_effect"


def test_a_rule_is_taken_back_by_perception_first_and_then_its_acceptances_by_the_controller(server):
    rule = m.PruningRule(nodes_kept=3)
    with server.client(user="ann") as client:
        assert client.post("/api/rule/undo", json={"nodes_kept": 3}).status_code == 200
        first, second = server.wire.asked
        assert first == UndoRule(user="ann", rule=rule)
        assert isinstance(second, RestoreAccepted) and (second.user, second.rule) == ("ann", rule)
        # Where perception cannot, nobody's acceptance is touched.
        server.wire.asked.clear()
        server.wire.answer = lambda request: m.Answer(
            ok=False, reason=said("the rule has been changed since; look again")
        )
        answer = client.post("/api/rule/undo", json={"nodes_kept": 3})
        assert (answer.status_code, answer.json()["reason"]) == (409, "the rule has been changed since; look again")
        assert [type(each) for each in server.wire.asked] == [UndoRule]
        server.wire.answer = lambda request: m.Answer(ok=isinstance(request, UndoRule), reason=said("it began since"))
        answer = client.post("/api/rule/undo", json={"nodes_kept": 3})
        assert answer.json()["code"] == "acceptances_not_restored"
        assert answer.json()["values"]["cause"]["values"] == {"text": "it began since"}


def spur_picture(jpeg: bytes, image: str, *cuts: str, spur: int = 3) -> SpurPicture:
    drawn = tuple(DrawnCut(point_id=name, revision=3, position=(9.0, 8.0), axis=((9.0, 8.0, 0.0),)) for name in cuts)
    drawing = SpurDrawing(
        vine=1, spur=spur, image=image, sequence=7, frame=(848, 480), window=(0, 0, 240, 180), size=(240, 180),
        cuts=drawn,
    )  # fmt: skip
    return SpurPicture(drawing=drawing, jpeg=jpeg)


def test_a_point_and_a_spur_have_a_picture_and_what_is_drawn_on_it(server):
    with server.client(role="viewer", user="bob") as client:
        for what in ("picture", "drawing"):
            unknown = client.get(f"/api/points/p1/{what}")
            assert (unknown.status_code, unknown.json()["code"]) == (404, "point_unknown")
            assert client.get(f"/api/spurs/1/3/{what}").status_code == 204
        server.wire.deliver(topics.POINTS, pruning_points(pruning_point("p1")))
        eventually(lambda: client.get("/api/points/p1/drawing").status_code == 204)
        server.wire.deliver(topics.PICTURES, spur_picture(b"picture", "aa", "p1"))
        drawing = client.get("/api/points/p1/drawing").json()
        assert drawing["image"] == "aa" and drawing["cuts"][0]["position"] == [9.0, 8.0]
        answer = client.get("/api/points/p1/picture?image=aa")
        assert (answer.content, answer.headers["content-type"]) == (b"picture", "image/jpeg")
        assert "immutable" in answer.headers["cache-control"]
        assert client.get("/api/points/p1/picture?image=bb").status_code == 204, "not another picture under a drawing"
        assert client.get("/api/spurs/1/3/picture").content == b"picture"
        # The point was cut: its last picture stays, and the spur has a new one.
        server.wire.deliver(topics.PICTURES, spur_picture(b"newer", "bb"))
        assert client.get("/api/points/p1/picture").content == b"picture"
        assert client.get("/api/spurs/1/3/picture").content == b"newer"
        assert client.get("/api/spurs/1/3/drawing").json()["cuts"] == []
        assert client.get("/api/spurs/1/-3/drawing").status_code == 422
    with server.visitor() as stranger:
        assert stranger.get("/api/points/p1/picture").status_code == 401
        assert stranger.get("/api/spurs/1/3/drawing").status_code == 401


def test_the_oldest_pictures_are_dropped(monkeypatch):
    monkeypatch.setattr("server.robots.pictures._MAX_PICTURES", 3)
    store = PictureStore()
    for number in (1, 2, 3, 1, 4):
        store.add(spur_picture(b"%d" % number, "aa", f"p{number}", spur=number))
    kept = [number for number in range(1, 5) if store.of_point(f"p{number}")]
    assert kept == [1, 3, 4] == [number for number in range(1, 5) if store.of_spur(1, number)]
