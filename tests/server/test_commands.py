import functools
import json
import threading
import time

import msgspec
import numpy as np
import pytest
import segno

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.commands import SeekReplay
from rolling_panda.errors import ServiceError
from rolling_panda.messages.supervision import (
    BaseVelocity,
    PointPlan,
    ReplayState,
    SessionPlan,
    StopRecord,
    StopState,
)
from rolling_panda.reasons import said
from server.api.responses import outcome
from tests.support import controller_at_work
from tests.support.fake_wire import (
    FakeWire,
    bridge_state,
    controller_state,
    joints,
    odometry,
    pruning_point,
    pruning_points,
    telling,
)
from tests.support.points import point, rolled_out
from tests.support.running_server import eventually, running_server


@pytest.fixture(scope="module")
def running():
    with running_server(FakeWire()) as server:
        yield server


@pytest.fixture
def server(running):
    running.wire.asked.clear()
    for sent in running.wire.sent.values():
        sent.clear()
    running.wire.answer = lambda request: m.Answer(ok=True, reason=said("done"))
    return running


@pytest.fixture
def robot(server):
    """A robot that says where it is until this is set."""
    with telling(server.wire) as silent:
        yield silent


@pytest.fixture
def client(server):
    with server.client(user="ann") as client:
        yield client


@pytest.mark.parametrize(
    ("path", "body", "intent"),
    [
        ("points/p7/accept", {"revision": 3}, intents.AcceptPoint(user="ann", point_id="p7", revision=3)),
        ("points/p7/reject", {"reason": "too high"}, intents.RejectPoint(user="ann", point_id="p7", reason="too high")),
        (
            "points/p7/resolve",
            {"outcome": "DONE", "reason": "the cane is off"},
            intents.ResolvePoint(user="ann", point_id="p7", outcome="DONE", reason="the cane is off"),
        ),
        ("points/p7/reconsider", None, intents.ReconsiderPoint(user="ann", point_id="p7")),
        ("points/p7/reject", {}, intents.RejectPoint(user="ann", point_id="p7")),
        ("points/accept-all", {"confidence": 0.5}, intents.AcceptAll(user="ann", confidence=0.5)),
        ("points/accept-all", {}, intents.AcceptAll(user="ann", confidence=0.8)),
        ("arm", None, intents.Arm(user="ann")),
        ("start", {}, intents.Start(user="ann")),
        ("pause", None, intents.Pause(user="ann")),
        ("resume", None, intents.Resume(user="ann")),
        ("home", None, intents.Home(user="ann")),
        ("survey", {"distance": 2.5}, intents.Survey(user="ann", distance=2.5)),
        ("look-again", {"vine": 2, "spur": 3}, intents.LookAgain(user="ann", vine=2, spur=3)),
        ("camera/check", None, intents.CheckCamera(user="ann")),
        ("camera/calibrate", None, intents.CalibrateCamera(user="ann")),
        ("base/calibrate", None, intents.CalibrateBase(user="ann")),
        ("base/use", {"made_at": 5.0}, intents.UseBase(user="ann", made_at=5.0)),
        ("arm/calibrate", None, intents.CalibrateArm(user="ann")),
        ("arm/use", {"made_at": 5.0}, intents.UseArm(user="ann", made_at=5.0)),
        ("timing/use", {"made_at": 5.0}, intents.UseTiming(user="ann", made_at=5.0)),
        ("acknowledge", None, intents.Acknowledge(user="ann")),
        ("reset", {"reason": "checked"}, intents.Reset(user="ann", reason="checked")),
        ("control/take", {"confirm": True}, intents.TakeControl(user="ann", confirm=True)),
        ("control/take", {}, intents.TakeControl(user="ann")),
        ("control/request", None, intents.RequestControl(user="ann")),
        ("control/grant", None, intents.GrantControl(user="ann")),
        ("control/return", None, intents.ReturnControl(user="ann")),
    ],
)
def test_each_request_becomes_its_intent(server, client, path, body, intent):
    answer = client.post(f"/api/{path}", json=body)
    assert (answer.status_code, answer.json()) == (200, outcome(True, said("done")))
    (asked,) = server.wire.asked
    # The role comes from the session, whatever a request says; the client is a key that is not the cookie's.
    assert asked.role == "supervisor" and asked.client and asked.client not in server.cookie(client)
    assert msgspec.structs.replace(asked, client="", role="operator") == intent


def test_a_refusal_of_the_catalogue_comes_with_its_code_and_values(server, client):
    server.wire.answer = lambda request: m.Answer(ok=False, reason=reasons.control_held("bob"))
    refused = reasons.control_held("bob")
    content = {"ok": False, "reason": reasons.text_of(refused), "code": "control_held", "values": {"user": "bob"}}
    answer = client.post("/api/arm")
    assert (answer.status_code, answer.json()) == (409, content)


def test_a_refusal_comes_with_its_reason_and_is_left_to_the_controller_to_log(server, client):
    server.wire.answer = lambda request: m.Answer(ok=False, reason=said("arm first"))
    answer = client.post("/api/start")
    assert (answer.status_code, answer.json()["reason"]) == (409, "arm first")
    texts = [event["text"] for event in client.get("/api/events").json()["events"]]
    assert not any("arm first" in text for text in texts)


def test_a_dead_controller_is_said_in_one_sentence(server, client):
    def dead(request):
        raise ServiceError("service/intent did not answer within 1.0 s: is the controller running?")

    server.wire.answer = dead
    answer = client.post("/api/start")
    assert answer.status_code == 503
    assert answer.json()["code"] == "service_silent"
    assert answer.json()["values"]["process"] == "controller"


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("points/p7/accept", {"revision": -1}),
        ("points/p7/accept", {"revision": True}),
        ("points/p7/accept", {"revision": 1.5}),
        ("points/p7/accept", {}),
        ("points/p7/accept", {"revision": 1, "extra": 1}),
        ("points/p 7/accept", {"revision": 1}),
        ("points/accept-all", {"confidence": 2}),
        ("points/accept-all", {"confidence": "0.5"}),
        ("reset", {"reason": ""}),
        ("reset", {"reason": "x" * 501}),
        ("teleop", {"hold": 1}),
        ("teleop", {"hold": True, "target": {"position": [0, 0], "quat_xyzw": [0, 0, 0, 1]}}),
    ],
)
def test_a_wrong_request_is_refused_and_asks_for_nothing(server, client, path, body):
    answer = client.post(f"/api/{path}", json=body)
    assert answer.status_code == 422
    assert answer.json()["ok"] is False
    assert answer.json()["reason"]
    assert server.wire.asked == []


@pytest.mark.parametrize("quat_xyzw", [[0, 0, 0, 0.5], [0, 0, 0, 0], [0.6, 0.6, 0.6, 0.6]])
def test_a_quaternion_of_another_length_than_one_leads_the_tool_nowhere(server, client, quat_xyzw):
    target = {"position": [0, 0, 0], "quat_xyzw": quat_xyzw}
    answer = client.post("/api/teleop", json={"hold": True, "target": target})
    assert (answer.status_code, answer.json()["code"]) == (409, "quaternion_not_unit")
    assert server.wire.sent[topics.TELEOP.name] == []


def test_a_method_that_is_not_known_is_told_which_are(client):
    for path, methods in {"/api/preview": {"GET", "POST"}, "/api/arm": {"POST"}, "/api/state": {"GET"}}.items():
        answer = client.put(path)
        assert answer.status_code == 405 and set(answer.headers["allow"].split(", ")) == methods


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_none_are_refused(server, client, number):
    headers = {"content-type": "application/json"}
    assert (
        client.post("/api/points/accept-all", content=f'{{"confidence": {number}}}', headers=headers).status_code == 422
    )
    position = f"[{number}, 0, 0]"
    body = f'{{"hold": true, "target": {{"position": {position}, "quat_xyzw": [0, 0, 0, 1]}}}}'
    assert client.post("/api/teleop", content=body, headers=headers).status_code == 422
    assert server.wire.sent[topics.TELEOP.name] == []


@pytest.mark.parametrize("content", [b"{", b"[" * 60_000, b"\xff", b"[]", b"null"])
def test_what_is_no_json_object_is_refused(server, client, content):
    headers = {"content-type": "application/json"}
    assert client.post("/api/reset", content=content, headers=headers).status_code in (400, 422)
    assert server.wire.asked == []


@pytest.mark.parametrize(
    ("latching", "status", "reason"),
    [
        (("bridge", "controller"), 200, reasons.stop_confirmed()),
        (("bridge",), 200, reasons.stop_half_confirmed()),
        (("controller",), 503, reasons.stop_unconfirmed()),
    ],
)
def test_stop_is_sent_several_times_and_says_who_has_latched_it(server, client, latching, status, reason):
    sent = server.wire.sent[topics.STOP.name]
    # A stop that was latched before confirms nothing.
    server.wire.deliver(topics.BRIDGE, bridge_state("an older one"))

    def latch():
        stop = eventually(lambda: sent)[0]
        record = StopRecord(stop.stop_id, stop.source, stop.user, stop.reason, 5.0)
        for process in latching:
            server.wire.deliver(topics.STOPS, StopState(process=process, stops=(record,)))

    robot = threading.Thread(target=latch)
    robot.start()
    answer = client.post("/api/stop", json={"reason": "branch"})
    robot.join()
    assert (answer.status_code, answer.json()["ok"]) == (status, status == 200)
    assert answer.json()["reason"] == reasons.text_of(reason)
    eventually(lambda: len(sent) == 5)
    assert {(stop.stop_id, stop.user, stop.reason) for stop in sent} == {
        (sent[0].stop_id, "ann", reasons.said("branch"))
    }


def test_a_press_that_was_confirmed_does_not_stop_again_after_the_reset(server, client):
    sent = server.wire.sent[topics.STOP.name]

    def ids():
        """Of the stops that were sent, in their order."""
        return list(dict.fromkeys(stop.stop_id for stop in sent))

    def post(press, browser=client):
        return browser.post("/api/stop", json={"reason": "branch", "press": press}).status_code

    # What nobody has confirmed is sent again, as the same stop.
    assert [post("a" * 16), post("a" * 16)] == [503, 503]
    eventually(lambda: len(sent) == 10)
    assert len(ids()) == 1
    server.wire.deliver(topics.BRIDGE, bridge_state(ids()[0]))
    assert post("a" * 16) == 200
    server.wire.deliver(topics.BRIDGE, bridge_state(""))
    eventually(lambda: len(sent) == 15)
    assert post("a" * 16) == 200
    assert len(sent) == 15
    # Another press, one of somebody else, and one that tells nothing are new ones.
    assert [post("b" * 16), post(""), post("")] == [503, 503, 503]
    with server.client(user="ben") as other:
        assert post("a" * 16, other) == 503
    eventually(lambda: len(sent) == 35)
    assert len(ids()) == 5


def test_stop_goes_out_although_nothing_else_lives_and_says_that_nobody_confirmed_it(server, client):
    server.wire.answer = None
    answer = client.post("/api/stop", json={})
    assert (answer.status_code, answer.json()["ok"]) == (503, False)
    assert answer.json()["code"] == "stop_unconfirmed"
    assert len(server.wire.sent[topics.STOP.name]) == 5
    assert server.wire.asked == []


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b"\xff",
        b"[" * 60_000,
        b'{"reason": 7}',
        b'{"reason": null}',
        b'{"extra": 1}',
        b'{"reason": ""}',
    ],
)
def test_a_stop_whose_body_cannot_be_read_stops(server, client, content):
    client.post("/api/stop", content=content, headers={"content-type": "application/json"})
    assert {stop.reason for stop in server.wire.sent[topics.STOP.name]} == {reasons.said("software stop")}


@pytest.mark.parametrize("body", [{"reason": "x" * 501}, {"reason": "x" * 9000, "extra": 1}])
def test_a_stop_with_too_long_a_reason_stops_with_its_beginning(server, client, body):
    client.post("/api/stop", json=body)
    (reason,) = {stop.reason for stop in server.wire.sent[topics.STOP.name]}
    text = dict(reason.values)["text"]
    assert text == "x" * len(text) and 100 < len(text) <= 500


def test_a_stop_with_a_body_that_no_request_may_have_stops(server, client):
    assert client.post("/api/stop", json={"reason": "x" * 70_000}).status_code == 503
    assert server.wire.sent[topics.STOP.name]
    assert client.post("/api/reset", json={"reason": "x" * 70_000}).status_code == 413


@pytest.mark.parametrize("reason", ["\ud800", "\x00", "🍇" * 600])
def test_what_a_stop_says_can_be_sent_on(server, client, reason):
    client.post("/api/stop", content=json.dumps({"reason": reason}))
    for stop in server.wire.sent[topics.STOP.name]:
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(stop), type=m.StopRequest) == stop
    assert server.wire.sent[topics.STOP.name]


def test_what_does_not_exist_is_not_found_and_what_exists_says_its_methods(client):
    for path in ("/api/nonsense", "/api", "/camera/depth", "/api/stop/"):
        assert client.post(path).status_code == 404, path
        assert client.get(path).status_code == 404, path
    assert client.post("/api/state").status_code == 405
    assert client.get("/nothing.js").status_code == 404


def test_a_viewer_may_stop_but_not_operate(server):
    with server.client(role="viewer") as viewer:
        assert viewer.post("/api/start").status_code == 403
        assert viewer.post("/api/teleop", json={"hold": True}).status_code == 403
        assert server.wire.asked == []
        viewer.post("/api/stop", json={})
        assert server.wire.sent[topics.STOP.name]


def test_only_a_supervisor_may_release_a_stop_or_invite(server):
    with server.client(role="operator") as operator:
        assert operator.post("/api/reset", json={"reason": "please"}).status_code == 403
        assert operator.post("/api/invite", json={"user": "x", "role": "supervisor"}).status_code == 403
    assert server.wire.asked == []


def test_an_invited_person_can_sign_in_with_their_role(server, client):
    link = client.post("/api/invite", json={"user": "bob", "role": "viewer"}).json()["link"]
    assert link.startswith(f"{server.address}/sign-in?token="), "it leads to the address that the supervisor uses"
    with server.visitor() as visitor:
        visitor.headers["origin"] = server.address
        assert visitor.post("/api/sign-in", json={"token": link.split("token=")[1]}).status_code == 200
        assert visitor.get("/api/me").json() == {"user": "bob", "role": "viewer"}


def test_an_invitation_is_a_qr_code_too(client):
    invited = client.post("/api/invite", json={"user": "bob", "role": "viewer"}).json()
    modules = np.array([[int(module) for module in row] for row in invited["qr"]], dtype=bool)
    assert modules.shape[0] == modules.shape[1] >= 25
    corner = modules[:7, :7]
    assert corner[0].all() and not corner[1, 1:6].any() and corner[2:5, 2:5].all(), "a mark to find it by"
    assert np.array_equal(modules, np.array([[*row] for row in segno.make_qr(invited["link"]).matrix], dtype=bool))


def test_state_and_points_are_what_the_robot_said_last(server, client):
    wire = server.wire
    wire.deliver(topics.JOINTS, joints())
    wire.deliver(topics.ODOMETRY, odometry(x=0.25))
    point = pruning_point("p9")
    wire.deliver(topics.POINTS, pruning_points(point))
    wire.deliver(topics.CONTROLLER, controller_state((m.QueueEntry("p9", "ACCEPTED", "next", "ann"),)))
    state = eventually(lambda: (got := client.get("/api/state").json())["base"] and got)
    assert state["base"]["x"] == 0.25
    assert state["controller"]["mode"] == "READY"
    assert state["role"] == "supervisor"
    rows = eventually(lambda: client.get("/api/points").json()["points"])
    assert [(row["point"]["point_id"], row["entry"]["state"]) for row in rows] == [("p9", "ACCEPTED")]


def test_a_calibration_is_used_only_where_the_controller_allows_it(server, client):
    why = reasons.wrong_mode("UseCamera", "IDLE, READY, PAUSED", "AUTO")

    def asked(code):
        answer = client.post("/api/camera/use", json={"made_at": 1.8e9})
        return answer if answer.status_code == code else None

    for refusal, code in ((why, 409), (None, 200)):
        told = msgspec.structs.replace(controller_state(), allowed={"UseCamera": refusal})
        server.wire.deliver(topics.CONTROLLER, told)
        answer = eventually(functools.partial(asked, code))
        assert answer.json()["reason"] == (reasons.text_of(why) if refusal else "done")
    assert server.wire.asked == [intents.UseCamera(user="ann", made_at=1.8e9)]


def holds(client, **wanted):
    """A script looks and holds; where its last hold lapsed it lets go, to hold anew the next time."""
    client.get("/api/state")
    if client.post("/api/teleop", json={"hold": True, **wanted}).status_code == 200:
        return True
    client.post("/api/teleop", json={"hold": False})
    return False


def test_a_script_can_move_the_tool_only_while_it_looks(server, robot, client):
    target = {"position": [0.3, 0.5, 1.0], "quat_xyzw": [0, 0, 0, 1]}

    assert client.post("/api/teleop", json={"hold": True, "target": target}).status_code == 409
    sent = server.wire.sent[topics.TELEOP.name]
    eventually(lambda: holds(client, target=target) and any(message.hold for message in sent))
    assert {message.target.position for message in sent if message.hold} == {(0.3, 0.5, 1.0)}
    eventually(lambda: not sent[-1].hold)


def test_a_script_that_fetches_the_state_of_a_silent_robot_may_not_hold(server, robot, client):
    eventually(lambda: client.get("/api/state").json()["base"])
    robot.set()
    time.sleep(0.7)
    client.get("/api/state")
    answer = client.post("/api/teleop", json={"hold": True, "base": {"linear": 0.1, "angular": 0.0}})
    assert (answer.status_code, answer.json()["code"]) == (409, "hold_view_stale")


def test_base_and_joints_can_be_moved_too_but_not_together(server, robot, client):
    sent = server.wire.sent[topics.TELEOP.name]

    def moving(**wanted):
        return holds(client, **wanted) and sent and sent[-1].hold and sent[-1]

    base = eventually(lambda: moving(base={"linear": 0.1, "angular": -0.2}))
    assert (base.target, base.base, base.joints) == (None, BaseVelocity(0.1, -0.2), None)
    jog = eventually(lambda: (got := moving(joints=[0, 0, 0.1, 0, 0, 0, 0])) and got.joints and got)
    assert jog.joints == (0, 0, 0.1, 0, 0, 0, 0) and jog.base is None
    both = {"hold": True, "joints": [0] * 7, "base": {"linear": 0.1, "angular": 0.0}}
    assert client.post("/api/teleop", json=both).status_code == 422
    fast = {"hold": True, "base": {"linear": 5.0, "angular": 0.0}}
    assert client.post("/api/teleop", json=fast).status_code == 422


def test_the_limits_of_the_arm_are_told_to_who_is_signed_in(server, client):
    limits = client.get("/api/robot").json()["arm_limits"]
    assert len(limits) == 7 and all(low < high for low, high in limits)
    assert limits[3][1] < 0.0, "the elbow of a Panda does not stretch"
    with server.visitor() as visitor:
        assert visitor.get("/api/robot").status_code == 401


def test_letting_go_by_rest_ends_the_hold(server, robot, client):
    target = {"position": [0.3, 0.5, 1.0], "quat_xyzw": [0, 0, 0, 1]}
    sent = server.wire.sent[topics.TELEOP.name]

    eventually(lambda: holds(client, target=target) and any(message.hold for message in sent))
    assert client.post("/api/teleop", json={"hold": False}).json() == {"ok": True, "reason": ""}
    eventually(lambda: not sent[-1].hold)


def test_openapi_describes_every_request_and_message_to_everybody(server):
    with server.visitor() as visitor:
        document = visitor.get("/api/openapi.json").json()
    for name in ("start", "stop", "teleop", "points/{point_id}/accept", "points/accept-all", "state", "sign-in"):
        assert f"/api/{name}" in document["paths"]
    assert "PageState" in document["components"]["schemas"]
    assert "reason" in str(document["paths"]["/api/stop"]["post"]["requestBody"])
    references = set(_references(document))
    assert {each.rsplit("/", 1)[-1] for each in references} <= set(document["components"]["schemas"])


def _references(node):
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "$ref":
                yield value
            else:
                yield from _references(value)
    elif isinstance(node, list):
        for value in node:
            yield from _references(value)


def test_the_plan_is_given_whole_and_its_absence_said(server, client):
    assert client.get("/api/plan").status_code == 503
    rolled = rolled_out("p1", 2, ends_s=3.0)
    point = PointPlan(point_id="p1", revision=2, order=1, base=m.PlanarPose(0.2), rollout=rolled)
    plan = SessionPlan(header=m.Header(), state="valid", plan_hash="ab", duration_s=7.0, points=(point,))
    server.wire.deliver(topics.PLAN, plan)
    given = client.get("/api/plan")
    assert given.status_code == 200
    assert msgspec.json.decode(given.content, type=SessionPlan) == plan
    schemas = client.get("/api/openapi.json").json()["components"]["schemas"]
    assert "rollout" in schemas["PointPlan"]["properties"] and "SessionPlan" in schemas


def test_who_reads_the_state_and_starts_at_once_is_not_told_that_nobody_has_seen_the_robot(server, robot, client):
    """Whatever of the wire comes first: here the controller hears who is there only after it is asked."""
    at_work = controller_at_work.robot()
    at_work.watching = False
    at_work.step()
    at_work.show((point("a", (0.4, 0.75, 1.0)),))
    at_work.step()
    server.wire.answer = at_work.ask
    assert client.post("/api/arm").status_code == 200
    assert client.post("/api/points/accept-all", json={}).status_code == 200
    refused = client.post("/api/start")
    assert refused.status_code == 409 and refused.json()["code"] == "never_watched"
    eventually(lambda: client.get("/api/state").json()["joints"] is not None)
    started = client.post("/api/start")
    assert started.status_code == 200, started.text


def test_who_fetches_the_state_is_known_to_have_seen_it_before_the_answer_is_there(running):
    with telling(running.wire), running.client(user="new") as client:
        eventually(lambda: client.get("/api/state").json()["joints"] is not None)
    with telling(running.wire), running.client(user="newer") as client:
        client.get("/api/state")
        told = running.wire.sent[topics.PRESENCE.name][-1]
        (newer,) = [person for person in told.people if person.user == "newer"]
        assert newer.view_age_s < 1.0
        # The first word after a silence does not wait for the next turn, which might come too late for the lease.
        told = [person for message in running.wire.sent[topics.PRESENCE.name] for person in message.people]
        assert any(person.user == "newer" and person.heard_age_s == 0.0 for person in told)


def test_a_recording_is_moved_in_and_a_robot_is_not():
    wire = FakeWire()
    with running_server(wire) as server, server.client("viewer") as client:
        refused = client.post("/api/replay", json={"position_s": 3.0})
        assert (refused.status_code, refused.json()["code"]) == (409, "no_recording")
        assert wire.asked == []
        state = ReplayState(name="a.mcap", begins_at=1.8e9, duration_s=9.0, position_s=0.0, playing=True)
        wire.deliver(topics.REPLAY, state)
        assert client.post("/api/replay", json={"position_s": 3.0, "playing": False}).status_code == 200
        assert wire.asked == [SeekReplay(position_s=3.0, playing=False)]
        assert client.post("/api/replay", json={"position_s": -1.0}).status_code == 422
        assert eventually(lambda: client.get("/api/state").json()["replay"])["name"] == "a.mcap"


def test_requests_for_motion_over_the_rate_limit_are_refused_and_a_release_is_not(monkeypatch):
    monkeypatch.setattr("server.robots.teleop.MOTION_RATE_HZ", 1e-3)
    monkeypatch.setattr("server.robots.teleop._MOTION_BURST", 2.0)
    velocity = {"hold": True, "base": {"linear": 0.1, "angular": 0.0}}
    with running_server(FakeWire()) as server, server.client() as client, server.client() as other:
        assert [client.post("/api/teleop", json=velocity).status_code for _ in range(3)] == [409, 409, 429]
        assert client.post("/api/teleop", json={"hold": False}).status_code == 200
        assert other.post("/api/teleop", json=velocity).status_code == 409, "each session has its own limit"
