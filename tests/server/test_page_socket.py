import json
import threading
import time
from contextlib import contextmanager

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.page import PageState, ProcessPresence
from rolling_panda.messages.supervision import StopState
from server.api.page_socket import StateThrottle
from server.config import ServerConfig
from tests.support.fake_wire import HEADER, FakeWire, controller_state, pruning_point, pruning_points, telling
from tests.support.running_server import PATIENCE_S, eventually, running_server


@pytest.fixture(scope="module")
def server():
    wire = FakeWire()
    with running_server(wire) as running, telling(wire):
        yield running


@pytest.fixture
def open_page(server):
    with server.client(user="ann") as client:
        yield lambda: Page(server, client)


@pytest.fixture
def page(open_page):
    with open_page() as page:
        yield page


class Page:
    """The browser's side of `/ws`."""

    def __init__(self, server, client):
        self.socket = server.socket(client)
        self.rendered = 0
        self.sequence = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def say(self, kind, **fields):
        self.socket.send(json.dumps({"type": kind, **fields}))

    def hear(self, kind, patience_s=PATIENCE_S):
        deadline = time.monotonic() + patience_s
        while True:
            message = json.loads(self.socket.recv(timeout=deadline - time.monotonic()))
            if message["type"] == "PageState":
                self.rendered = message["number"]
            if message["type"] == kind:
                return message

    def hear_event(self, text):
        while not any(text in event["text"] for event in self.hear("PageEvents")["events"]):
            pass

    def hold_until_sent(self, server):
        """Hold, as a page does with a pressed button, until the server has told the robot so; returns what it is told.

        The gizmo is shown.
        """
        sent = server.wire.sent[topics.TELEOP.name]
        sent.clear()
        self.look()
        self.say("ShowGizmo", visible=True)

        def told():
            for _ in range(10):
                self.look()
                self.hold(True)
                if any(message.hold for message in sent):
                    return True
            # Refused, since this machine has paused for longer than a view may be old: press anew.
            self.hold(False)
            return False

        eventually(told)
        return sent

    def hold(self, hold):
        self.sequence += 1
        self.say("Hold", sequence=self.sequence, hold=hold)

    def look(self):
        while self.hear("PageState")["base"] is None:
            pass
        self.say("Ping", number=1, rendered=self.rendered)
        self.hear("Pong")


def test_a_page_gets_states_with_its_user_and_growing_numbers(page):
    first, second = page.hear("PageState"), page.hear("PageState")
    assert second["number"] > first["number"]
    assert (second["user"], second["role"], second["viewers"]) == ("ann", "supervisor", 1)
    assert first["bridge_age_s"] is None
    assert {row["process"] for row in first["processes"]} == {"bridge", "controller", "perception", "server"}


def test_a_page_that_may_only_look_on_is_told_half_as_often(server):
    with server.client(user="vi", role="viewer") as client, Page(server, client) as page:
        page.hear("PageState")
        assert [page.hear("PageState")["number"] % 2 for _ in range(3)] == [0, 0, 0]


def test_a_page_that_may_only_look_on_holds_nothing_and_is_told_for_its_role(server):
    with server.client(user="vi", role="viewer") as client, Page(server, client) as page:
        page.hear("PageState")
        page.hold(True)
        assert page.hear("HoldEnded")["reason"]["code"] == "viewer_only"


def test_a_ping_is_answered_with_its_number(page):
    page.hear("PageState")
    page.say("Ping", number=77, rendered=0)
    assert page.hear("Pong")["number"] == 77


def test_points_come_when_they_change_and_not_again(server, page):
    server.wire.deliver(topics.POINTS, pruning_points(pruning_point("a"), pruning_point("b")))
    queue = (m.QueueEntry("b", "ACCEPTED", "next", "ann"),)
    server.wire.deliver(topics.CONTROLLER, controller_state(queue))
    while len((points := page.hear("PagePoints"))["points"]) != 2:
        pass
    rows = [(row["point"]["point_id"], row["entry"]["state"]) for row in points["points"]]
    assert rows == [("b", "ACCEPTED"), ("a", "PROPOSED")]
    server.wire.deliver(topics.POINTS, pruning_points(pruning_point("a"), pruning_point("b")))
    server.wire.deliver(topics.CONTROLLER, controller_state(queue))
    with pytest.raises(TimeoutError):
        page.hear("PagePoints", patience_s=0.5)


def test_what_the_other_processes_log_reaches_the_page(server, page):
    page.hear("PageEvents")
    event = m.LogEvent(header=HEADER, process="bridge", reason=reasons.watchdog_holds())
    server.wire.deliver(topics.EVENT, event)
    (line,) = page.hear("PageEvents")["events"]
    assert (line["process"], line["severity"]) == ("bridge", "warning")
    assert line["text"] == reasons.text_of(reasons.watchdog_holds())


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "nonsense",
        '{"type":"Ping","number":1}',
        '{"type":"Ping","number":1,"rendered":0,"extra":1}',
        '{"type":"Ping","number":NaN,"rendered":0}',
        '{"type":"Hold","sequence":1,"hold":1}',
        '{"type":"PageState"}',
        '{"type":"Select","point_id":"' + "x" * 65 + '"}',
        "[" * 10_000,
    ],
)
def test_a_page_that_breaks_the_rules_is_closed(page, text):
    page.hear("PageState")
    page.socket.send(text)
    with pytest.raises(ConnectionClosed) as caught:
        page.hear("never")
    assert caught.value.rcvd.code == 1008


@pytest.mark.parametrize(
    "text", [["x" * 30_000] * 3, "x" * (ServerConfig().max_body_bytes + 1)], ids=["parts", "too long"]
)
def test_a_message_in_too_many_parts_or_too_long_closes_the_socket(page, text):
    with pytest.raises(ConnectionClosed) as caught:
        page.socket.send(text)
        page.hear("never")
    assert caught.value.rcvd.code == 1009


def test_the_tool_follows_while_the_page_holds_and_stops_when_it_falls_silent(server, page):
    sent = page.hold_until_sent(server)
    eventually(lambda: not sent[-1].hold)
    assert {message.user for message in sent if message.hold} == {"ann"}


@contextmanager
def holding_page(**config):
    """A page that holds, with a server that hardly ever looks by itself whether it still does."""
    wire = FakeWire()
    config = ServerConfig(**{"teleop_rate_hz": 0.01, "view_timeout_s": 20.0, **config})
    with running_server(wire, config) as server, telling(wire) as silent, server.client(user="ann") as client:
        with Page(server, client) as page:
            page.server, page.robot_silent = server, silent
            page.sent = wire.sent[topics.TELEOP.name]
            page.told = lambda: [event["text"] for event in client.get("/api/events").json()["events"]]
            page.say("ShowGizmo", visible=True)

            def held():
                page.look()
                page.hold(True)
                page.look()
                return any("ann holds the robot" in text for text in page.told()) or page.hold(False)

            eventually(held)
            yield page


@pytest.fixture
def late_page():
    """A page whose late renewal itself is what ends its hold."""
    with holding_page(hold_resume_s=2.0) as page:
        yield page


def test_letting_go_is_said_at_once_not_with_the_next_turn(late_page):
    late_page.hold(False)
    eventually(lambda: late_page.sent and not late_page.sent[-1].hold, 1.0)


def test_a_hold_that_paused_for_a_moment_begins_anew_from_the_tool(late_page):
    time.sleep(0.3)
    late_page.look()
    late_page.hold(True)
    eventually(lambda: sum("holds the robot" in text for text in late_page.told()) == 2)
    assert not any("refused" in text for text in late_page.told()), late_page.told()
    assert sum("not renewed" in text for text in late_page.told()) == 1


@pytest.mark.long
def test_a_hold_that_paused_for_long_is_over_until_it_is_pressed_anew(late_page):
    time.sleep(2.2)
    late_page.look()
    late_page.hold(True)
    assert late_page.hear("HoldEnded")["reason"]["code"] == "hold_interrupted"
    for _ in range(3):
        late_page.look()
        late_page.hold(True)
    late_page.look()
    assert sum("holds the robot" in text for text in late_page.told()) == 1
    late_page.hold(False)
    late_page.look()
    late_page.hold(True)
    eventually(lambda: sum("holds the robot" in text for text in late_page.told()) == 2)
    assert sum("not renewed" in text for text in late_page.told()) == 1


@pytest.mark.long
def test_a_page_that_draws_a_robot_that_has_fallen_silent_may_not_hold():
    with holding_page(view_timeout_s=0.5) as page:
        page.robot_silent.set()
        time.sleep(0.7)
        page.hold(False)
        for _ in range(3):
            page.look()
        page.hold(True)
        assert page.hear("HoldEnded")["reason"]["code"] == "hold_view_stale"


def test_letting_go_is_said_at_once(server, page):
    sent = page.hold_until_sent(server)
    page.hold(False)
    eventually(lambda: not sent[-1].hold)
    page.hear_event("ann let go of the robot")


def test_a_page_that_closes_ends_its_hold(server, open_page):
    with open_page() as page:
        sent = page.hold_until_sent(server)
    eventually(lambda: not sent[-1].hold)


def test_a_page_that_has_not_drawn_the_robot_may_not_hold(server, page):
    sent = server.wire.sent[topics.TELEOP.name]
    sent.clear()
    page.hear("PageState")
    page.say("ShowGizmo", visible=True)
    page.say("Hold", sequence=1, hold=True)
    assert page.hear("HoldEnded")["reason"]["code"] == "hold_view_stale"
    page.hear_event("The view of the robot is not current")
    page.sequence = 1
    page.look()
    page.hold(True)
    page.look()
    assert not any(message.hold for message in sent)


@pytest.mark.long
def test_a_stop_ends_the_hold_of_the_page_that_held():
    with holding_page(hold_timeout_s=20.0) as page, page.server.client(user="bob") as other:
        other.post("/api/stop")
        assert page.hear("HoldEnded")["reason"]["code"] == "hold_stopped"


def test_an_old_hold_that_arrives_late_is_ignored(server, page):
    sent = server.wire.sent[topics.TELEOP.name]
    page.look()
    page.say("ShowGizmo", visible=True)
    page.say("Hold", sequence=5, hold=False)
    sent.clear()
    page.say("Hold", sequence=4, hold=True)
    page.say("Ping", number=9, rendered=0)
    page.hear("Pong")
    assert not any(message.hold for message in sent)


def test_a_second_person_cannot_take_the_tool_from_the_holder(server, page):
    with server.client(user="bob") as other, Page(server, other) as second:
        second.look()
        second.say("ShowGizmo", visible=True)
        sent = page.hold_until_sent(server)
        page.hold(True)
        second.hold(True)
        second.hear_event("ann is holding")
    assert {message.user for message in sent if message.hold} == {"ann"}


def test_a_page_that_does_not_read_slows_nobody_down(server, open_page, page):
    with open_page() as deaf:
        for number in range(20):
            deaf.say("Ping", number=number, rendered=0)
            page.hear("PageState")
        page.say("Ping", number=3, rendered=0)
        assert page.hear("Pong")["number"] == 3


def test_the_heartbeat_of_the_server_keeps_time(server):
    beats = server.wire.sent[topics.HEARTBEAT.name]
    beats.clear()
    began = time.monotonic()
    eventually(lambda: len(beats) >= 21)
    assert time.monotonic() - began > 0.9
    assert all(after.sequence == before.sequence + 1 for before, after in zip(beats, beats[1:], strict=False))


def state(number: int, **more: object) -> PageState:
    shown = PageState(
        number=number,
        user="",
        role="viewer",
        viewers=1,
        processes=(ProcessPresence("bridge", True, 0.0),),
        controller=controller_state(),
        controller_age_s=0.0,
        bridge=None,
        bridge_age_s=None,
        joints=None,
        base=None,
        camera_frame=0,
    )
    return msgspec.structs.replace(shown, **more)


@given(st.integers(1, 10), st.integers(0, 1000))
def test_whoever_may_operate_is_told_all_and_a_viewer_its_share(every: int, first: int) -> None:
    operator, viewer = StateThrottle(10.0, 10.0 / every), StateThrottle(10.0, 10.0 / every)
    states = [state(number) for number in range(first, first + 10 * every)]
    assert all(operator.is_due(each, True) for each in states)
    told = [each.number for each in states if viewer.is_due(each, False)]
    assert told[0] == first, "a page that was just opened waits for nothing"
    assert 10 <= len(told) <= 11
    assert not viewer.is_due(states[-1], False) and not operator.is_due(states[-1], True), "nothing is told twice"


def test_a_viewer_hears_of_a_stop_a_mode_and_a_lost_process_at_once() -> None:
    throttle = StateThrottle(10.0, 1.0)
    assert throttle.is_due(state(10), False)
    assert not throttle.is_due(state(11), False)
    stopped = {"stops": (StopState(process="bridge", stops=(), hardware=True),)}
    assert throttle.is_due(state(12, **stopped), False)
    assert not throttle.is_due(state(13, **stopped), False)
    other = {**stopped, "controller": msgspec.structs.replace(controller_state(), mode="PAUSED")}
    assert throttle.is_due(state(14, **other), False)
    assert throttle.is_due(state(15, **other, processes=(ProcessPresence("bridge", False, 3.0),)), False)
    assert not throttle.is_due(state(16, **other, processes=(ProcessPresence("bridge", False, 3.1),)), False)


@pytest.mark.long
def test_a_page_that_does_not_read_is_dropped_and_one_that_reads_stays():
    wire = FakeWire()
    config = ServerConfig(unread_s=2.0, page_rate_hz=100.0)
    with running_server(wire, config) as server, telling(wire), server.client(user="ann") as client:

        def look(page):
            try:
                for _ in page:
                    pass
            except ConnectionClosed:
                pass

        # A page of the library's reads ahead a few messages, and answers pings only as far as it has read.
        with server.socket(client, max_queue=16) as reading, server.socket(client, max_queue=16):
            reader = threading.Thread(target=look, args=(reading,))
            reader.start()
            eventually(lambda: client.get("/api/state").json()["viewers"] == 2)
            eventually(lambda: client.get("/api/state").json()["viewers"] == 1)
            said = [line["text"] for line in client.get("/api/events").json()["events"]]
            assert [text for text in said if "did not read" in text] == [
                reasons.text_of(reasons.page_closed("ann", reasons.socket_unread()))
            ]
            assert reader.is_alive()
        reader.join()
