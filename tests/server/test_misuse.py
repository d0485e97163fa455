"""Somebody with a browser's console, a script or a foreign page tries what no page does."""

import itertools
import time

import pytest
from websockets.exceptions import ConnectionClosed

from rolling_panda import reasons, topics
from rolling_panda.messages.supervision import ControlState
from tests.server.test_page_socket import Page
from tests.support.fake_wire import FakeWire, telling
from tests.support.running_server import eventually, running_server


@pytest.fixture(scope="module")
def server():
    wire = FakeWire()
    with running_server(wire) as running, telling(wire):
        yield running


def control(holder):
    return ControlState(
        holder=holder, user="", expires_s=1.0, requested_by="", requested_key="", next_user="", notice=None,
        notice_number=0, supervised=True,
    )  # fmt: skip


def lines(server):
    return len(server.wire.sent[topics.EVENT.name])


def test_who_does_not_hold_control_cannot_keep_the_tool_from_who_does(server):
    with (
        server.client("operator", "ann") as ann,
        server.client("operator", "eve") as eve,
        Page(server, ann) as holder,
        Page(server, eve) as other,
    ):
        server.wire.deliver(topics.CONTROL, control(ann.get("/api/state").json()["client"]))
        try:
            other.look()
            other.say("ShowGizmo", visible=True)
            other.hold(True)
            refused = reasons.hold_refused("eve", reasons.control_held(""))
            eventually(lambda: refused in [event.reason for event in server.wire.sent[topics.EVENT.name]])
            assert not any(message.hold for message in server.wire.sent[topics.TELEOP.name])
            sent = holder.hold_until_sent(server)
            assert {message.user for message in sent if message.hold} == {"ann"}
        finally:
            server.wire.deliver(topics.CONTROL, control(""))


def test_a_page_that_floods_the_server_is_closed_and_nobody_else_notices(server):
    with server.client("viewer", "eve") as eve, server.client(user="ann") as ann:
        with Page(server, ann) as page, Page(server, eve) as flood:
            with pytest.raises(ConnectionClosed):
                for number in itertools.count():
                    flood.say("Ping", number=number, rendered=0)
                    if number % 100 == 0:
                        flood.hear("Pong")
            assert flood.socket.close_code == 1008
            page.say("Ping", number=7, rendered=0)
            assert page.hear("Pong")["number"] == 7


def test_what_nobody_may_do_does_not_fill_the_log(server):
    before = lines(server)
    with server.client("viewer", "eve") as eve, Page(server, eve) as page, server.visitor() as foreign:
        for _ in range(150):
            page.say("ShowGizmo", visible=True)
        for number in range(60):
            foreign.post(f"/api/{number}", headers={"origin": f"https://{number}.example"})
        page.say("Ping", number=1, rendered=0)
        page.hear("Pong")
    time.sleep(0.2)
    assert 20 < lines(server) - before < 60


def test_a_viewer_neither_holds_nor_lets_go(server):
    with server.client("viewer", "eve") as eve:
        for hold in (True, False):
            answer = eve.post("/api/teleop", json={"hold": hold, "base": {"linear": 0.1, "angular": 0.0}})
            assert answer.status_code == 403


def test_a_forwarded_address_is_not_believed(server):
    answers = []
    with server.visitor() as visitor:
        visitor.headers["origin"] = server.address
        for number in range(8):
            visitor.headers["x-forwarded-for"] = f"10.0.0.{number}"
            answers.append(visitor.post("/api/sign-in", json={"token": "x" * 40}).status_code)
    assert answers[:4] == [401] * 4 and 429 in answers[4:]
