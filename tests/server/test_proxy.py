import json
import time
from contextlib import contextmanager

import msgspec
import numpy as np
import psutil
import pytest
import zstandard
from playwright.sync_api import sync_playwright
from viser import _messages
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from rolling_panda import topics
from tests.server.test_client_messages import CAMERA, CLICK, DRAG, FORGED, GRAB, LET_GO, POINTER
from tests.support.chromium import FLAGS
from tests.support.fake_wire import FakeWire, joints, odometry, pruning_point, pruning_points, telling
from tests.support.running_server import PATIENCE_S, eventually, running_server

_PLACING = ("SetPositionMessage", "SetOrientationMessage")


def listening():
    """Ports that this process listens on; other tests' servers may be among them."""
    return {c.laddr.port for c in psutil.Process().net_connections("tcp") if c.status == psutil.CONN_LISTEN}


@pytest.fixture(scope="module")
def view_port():
    """Port of viser behind `server`, known once that runs."""
    return []


@pytest.fixture(scope="module")
def server(view_port):
    wire, before = FakeWire(), listening()
    with running_server(wire) as running:
        view_port.extend(listening() - before - {int(running.address.rsplit(":", 1)[1])})
        wire.deliver(topics.JOINTS, joints())
        wire.deliver(topics.ODOMETRY, odometry())
        wire.deliver(topics.POINTS, pruning_points(pruning_point("p1")))
        with running.client() as client:
            eventually(lambda: {"/robot/panda_joint1", "/vines/0"} <= drawn(running, client))
        yield running


def drawn(server, client):
    """Names of what has been placed in the view."""
    with server.socket(client, "/viser") as view:
        return {message["name"] for message in hear(view, replayed) if message["type"] in _PLACING}


def messages(frame):
    """The messages in one frame from viser."""
    size = int.from_bytes(frame[8:16], "little")
    inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size], int.from_bytes(frame[:8], "little"))
    return msgspec.msgpack.decode(inner)["messages"]


def hear(view, condition, patience_s=PATIENCE_S):
    """All messages until one fulfils `condition`."""
    heard = []
    deadline = time.monotonic() + patience_s
    while not any(condition(message) for message in heard):
        heard += messages(view.recv(timeout=deadline - time.monotonic()))
    return heard


def never(view, condition):
    """Nothing that fulfils `condition` comes soon."""
    with pytest.raises(TimeoutError):
        hear(view, condition, patience_s=0.4)


def replayed(message):
    return message["type"] == "ReplayDoneMessage"


def say(view, message):
    view.send(msgspec.msgpack.encode(message))


@contextmanager
def page_and_view(server, role="supervisor", user="test"):
    """Somebody's page and their view, which is drawn."""
    with (
        server.client(role=role, user=user) as client,
        server.socket(client) as page,
        server.socket(client, "/viser") as view,
    ):
        hear(view, replayed)
        say(view, CAMERA)
        yield page, view


@contextmanager
def two_views(server, role="supervisor"):
    """Ann's page, her view and Bob's, both drawn."""
    with page_and_view(server, role, "ann") as (page, view), page_and_view(server, user="bob") as (_, other_view):
        yield page, view, other_view


def test_the_view_shows_the_robot_and_the_points(server):
    with server.client() as client, server.socket(client, "/viser") as view:
        assert view.subprotocol == "viser-v1.1.1"
        names = {message.get("name") for message in hear(view, replayed)}
        assert "/robot" in names
        assert any("panda_joint7" in (name or "") for name in names)
        say(view, CAMERA)
        hear(view, lambda message: message.get("name") == "/markers/proposed/tint")


def test_every_movement_is_shown_and_nothing_is_sent_at_rest(server):
    with server.client() as client, server.socket(client, "/viser") as view:
        hear(view, replayed)
        never(view, lambda message: message["type"].startswith("Set"))
        for step in range(1, 11):
            server.wire.deliver(topics.ODOMETRY, odometry(sequence=step, x=0.01 * step))
            moved = [message for message in hear(view, places_robot) if message["type"].startswith("Set")]
            assert {message["name"] for message in moved} - {"/trail/dots"} == {"/robot"}
            (robot,) = [message for message in moved if message["name"] == "/robot" and "position" in message]
            assert robot["position"][0] == pytest.approx(0.01 * step)


def places_robot(message):
    return message["type"] == "SetPositionMessage" and message["name"] == "/robot"


def marker_owner(view):
    """What viser calls the view that a marker is drawn for, once it is drawn; a click on it says so."""
    heard = hear(view, lambda message: message.get("name") == "/markers/proposed/tint")
    return next(message["owner"] for message in heard if message.get("name") == "/markers/proposed/tint")


def test_a_click_on_a_point_selects_it_on_the_pages_of_that_session_alone(server):
    with (
        server.client() as client,
        server.client() as other,
        server.socket(client) as page,
        server.socket(other) as other_page,
        server.socket(client, "/viser") as view,
    ):
        hear(view, replayed)
        say(view, CAMERA)
        say(view, CLICK | {"owner": marker_owner(view)})
        assert hear_kind(page, "Selected")["point_id"] == "p1"
        hear(view, lambda message: message.get("name") == "/markers/halo")
        kinds = [json.loads(other_page.recv(timeout=PATIENCE_S))["type"] for _ in range(5)]
        assert "Selected" not in kinds


def hear_kind(page, kind):
    while True:
        message = json.loads(page.recv(timeout=PATIENCE_S))
        if message["type"] == kind:
            return message


def enables_clicks(message):
    return message["type"] == "ScenePointerEnableMessage" and message["event_type"] == "click"


def hear_clicks(view):
    """With which keys held down the view takes clicks from now on; empty where it takes none."""
    return [message for message in hear(view, enables_clicks) if enables_clicks(message)][-1]["modifiers"]


def test_clicks_into_the_view_are_lines_of_sight_while_a_page_places_points(server):
    with page_and_view(server) as (page, view):
        page.send(json.dumps({"type": "PlaceByHand", "active": True}))
        assert hear_clicks(view)
        say(view, POINTER)
        line = hear_kind(page, "PickRay")
        assert (line["origin"], line["direction"]) == ([0.0, 0.0, 1.5], [0.0, 1.0, 0.0])
        page.send(json.dumps({"type": "PlaceByHand", "active": False}))
        assert not hear_clicks(view)
        page.send(json.dumps({"type": "PlaceByHand", "active": True}))
        assert hear_clicks(view)
        page.close()
        assert not hear_clicks(view), "nobody is left who places"


class Holding:
    """A page that holds, as a person's does: each state that comes is rendered, and the hold renewed."""

    def __init__(self, page):
        self.page, self.sequence = page, 0

    def answer(self, **wanted):
        """Answer the next message; a hold that was refused, as its view was not current, is pressed anew."""
        message = json.loads(self.page.recv(timeout=PATIENCE_S))
        if message["type"] not in ("PageState", "HoldEnded"):
            return False
        ping = {"type": "Ping", "number": self.sequence + 1, "rendered": message.get("number", 0)}
        self.page.send(json.dumps(ping))
        self.send(hold=message["type"] == "PageState", **wanted)
        return True

    def send(self, **fields):
        self.sequence += 1
        self.page.send(json.dumps({"type": "Hold", "sequence": self.sequence, **fields}))


def test_the_gizmo_is_on_the_holders_view_alone_and_its_drags_become_targets(server):
    sent = server.wire.sent[topics.TELEOP.name]
    with telling(server.wire), two_views(server) as (page, view, other_view):
        page.send('{"type":"ShowGizmo","visible":true}')
        (gizmo,) = [each for each in hear(view, is_gizmo) if is_gizmo(each)]
        never(other_view, is_gizmo)
        say(view, GRAB | {"owner": gizmo["owner"]})
        holding = Holding(page)

        def hold():
            # Where a hold lapses, the gizmo goes back to the tool.
            say(view, DRAG | {"owner": gizmo["owner"], "position": [0.31, 0.52, 0.93]})
            holding.answer()
            return any(each.hold and each.target.position == (0.31, 0.52, 0.93) for each in sent)

        eventually(hold)
        holding.send(hold=False)
        say(view, LET_GO | {"owner": gizmo["owner"]})
        assert hear_gizmo(view) != [0.31, 0.52, 0.93]


def test_where_a_drag_ended_after_the_hold_leads_nobody(server):
    with telling(server.wire), page_and_view(server, user="liz") as (page, view):
        page.send('{"type":"ShowGizmo","visible":true}')
        shown = hear(view, places_gizmo)
        (owner,) = {each["owner"] for each in shown if is_gizmo(each)}
        (tool,) = [each["position"] for each in shown if places_gizmo(each)]
        # As the 3-D client does: it keeps back the last place for up to 50 ms, and tells it when the pointer is up.
        for said in (DRAG | {"position": [0.4, 0.5, 0.9]}, LET_GO):
            say(view, said | {"owner": owner})
        assert hear_gizmo(view) == pytest.approx(tool, abs=1e-3)


def test_a_page_holds_base_or_joints_at_a_share_of_the_speed(server):
    sent = server.wire.sent[topics.TELEOP.name]
    del sent[:]
    with telling(server.wire), server.client(user="eve") as client, server.socket(client) as page:
        holding = Holding(page)

        def holds(**wanted):
            def once():
                holding.answer(**wanted, speed_scale=0.5)
                newest = [each for each in sent if each.hold and each.speed_scale == 0.5][-1:]
                return bool(newest) and msgspec.to_builtins(newest[0]).items() >= wanted.items()

            return once

        drive = {"linear": 0.2, "angular": -0.1}
        eventually(holds(base=drive))
        eventually(holds(joints=(0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
        holding.send(hold=True, base=drive, joints=[0.0] * 7)
        with pytest.raises(ConnectionClosed):
            while True:
                page.recv(timeout=PATIENCE_S)


def hear_gizmo(view):
    """Where the view draws the gizmo from now on."""
    return [each["position"] for each in hear(view, places_gizmo) if places_gizmo(each)][-1]


def places_gizmo(message):
    return message["type"] == "SetPositionMessage" and message["name"] == "/gizmo"


def is_gizmo(message):
    return message["type"] == "TransformControlsMessage"


def test_a_forged_message_never_reaches_viser_and_is_logged(server, monkeypatch):
    reached = []
    deserialize = _messages.Message.deserialize.__func__

    def spy(cls, data):
        message = deserialize(cls, data)
        reached.append(type(message).__name__)
        return message

    monkeypatch.setattr(_messages.Message, "deserialize", classmethod(spy))
    with server.client() as client, server.socket(client, "/viser") as view:
        say(view, FORGED)
        say(view, {"type": "ShareUrlRequest"})
        say(view, CAMERA)
        eventually(lambda: "ViewerCameraMessage" in reached)
        texts = [event["text"] for event in client.get("/api/events").json()["events"]]
    assert set(reached) == {"ViewerCameraMessage"}
    assert any("GuiUpdateMessage" in text for text in texts)
    assert any("ShareUrlRequest" in text for text in texts)


def test_a_viewer_cannot_click(server):
    with page_and_view(server, role="viewer") as (page, view):
        page.send(json.dumps({"type": "PlaceByHand", "active": True}))
        never(view, enables_clicks)
        say(view, CLICK)
        kinds = [json.loads(page.recv(timeout=PATIENCE_S))["type"] for _ in range(6)]
        assert "Selected" not in kinds


def test_another_version_of_the_view_is_told_so(server):
    with server.client() as client, pytest.raises(ConnectionClosed) as caught:
        with server.socket(client, "/viser", subprotocols=["viser-v0.0.1"]) as view:
            view.recv(timeout=PATIENCE_S)
    assert caught.value.rcvd.code == 1002
    assert "mismatch" in caught.value.rcvd.reason.lower()


def test_signing_out_closes_the_view(server):
    with server.client() as client, server.socket(client, "/viser") as view:
        hear(view, replayed)
        client.post("/api/sign-out")
        with pytest.raises(ConnectionClosed):
            hear(view, lambda message: False, patience_s=1.0)


def test_who_goes_around_the_proxy_is_thrown_out(server, view_port):
    (port,) = view_port
    with pytest.raises(ConnectionClosed) as caught:
        with connect(f"ws://127.0.0.1:{port}/", subprotocols=["viser-v1.1.1"], proxy=None) as view:
            while True:
                view.recv(timeout=PATIENCE_S)
    assert caught.value.rcvd.code == 1008
    with server.client() as client:
        texts = [event["text"] for event in client.get("/api/events").json()["events"]]
    assert any("outside the page" in text for text in texts)


def test_the_client_page_is_compressed_and_kept_by_the_browser(server):
    with server.client() as client:
        first = client.get("/viser/")
        assert first.headers["content-encoding"] == "gzip"
        again = client.get("/viser/", headers={"if-none-match": first.headers["etag"]})
        assert again.status_code == 304


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.parametrize("comes", [True, False])
def test_the_client_waits_for_the_pages_own_file_and_does_without_it_where_it_does_not_come(server, browser, comes):
    with server.client() as client:
        context = browser.new_context(base_url=server.address)
        context.add_cookies([{"name": n, "value": v, "url": server.address} for n, v in client.cookies.items()])
    page = context.new_page()

    def late(route):
        time.sleep(1.0)
        if comes:
            route.continue_()
        else:
            route.abort()

    page.route("**/offscreen-framebuffer.js", late)
    page.add_init_script("""new MutationObserver((_, looking) => {
      if (!document.querySelector("#root > *")) return;
      window.beganWith = location.search;
      looking.disconnect();
    }).observe(document, { childList: true, subtree: true });""")
    page.goto("/viser/")
    page.wait_for_function("window.beganWith !== undefined", timeout=1000 * PATIENCE_S)
    assert page.evaluate("beganWith").startswith("?fixedDpr=") == comes
    context.close()


@pytest.mark.long
@pytest.mark.browser
def test_the_wheel_zooms_towards_the_pointer(server, chromium_path):
    cameras = []

    def sent(frame):
        message = msgspec.msgpack.decode(frame)
        if message["type"] == "ViewerCameraMessage":
            cameras.append(message)

    with server.client() as client, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=chromium_path, args=list(FLAGS))
        context = chromium.new_context(base_url=server.address, locale="en-US", viewport={"width": 600, "height": 400})
        context.add_cookies([{"name": n, "value": v, "url": server.address} for n, v in client.cookies.items()])
        page = context.new_page()
        page.on("websocket", lambda socket: socket.on("framesent", sent))
        page.goto("/viser/")
        page.wait_for_function("document.documentElement.dataset.view === 'drawn'", timeout=1000 * PATIENCE_S)
        page.wait_for_timeout(1000)
        before = cameras[-1]
        page.mouse.move(540, 200)
        for _ in range(4):
            page.mouse.wheel(0, -200)
            page.wait_for_timeout(200)
        page.wait_for_timeout(1000)
        after = cameras[-1]
        chromium.close()
    way = np.subtract(after["position"], before["position"])
    ahead = np.subtract(before["look_at"], before["position"])
    right = np.cross(ahead, before["up_direction"])
    assert way @ ahead > 0.0, "nearer"
    angle = np.degrees(np.arctan2(way @ right / np.linalg.norm(right), way @ ahead / np.linalg.norm(ahead)))
    # Four fifths of the way from the middle to the right edge.
    edge = np.tan(before["fov"] / 2) * 600 / 400
    assert angle == pytest.approx(np.degrees(np.arctan(0.8 * edge)), abs=4.0)
