"""A real server against clients that are slow, many, or say too much."""

import contextlib
import json
import socket
import ssl
import time

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed

from rolling_panda import reasons, topics
from server.auth.access import Access, Tls
from server.config import ServerConfig
from tests.server.test_client_messages import CAMERA
from tests.support.certificates import self_signed
from tests.support.fake_wire import FakeWire, telling
from tests.support.running_server import PATIENCE_S, eventually, running_server


def noted(server):
    """What the server has written into the log."""
    return [event.reason for event in server.wire.sent[topics.EVENT.name]]


HEAD = b"GET /api/health HTTP/1.1\r\nHost: a\r\n"
BODY = b"POST /api/sign-in HTTP/1.1\r\nHost: a\r\nOrigin: %s\r\nContent-Length: 100\r\n\r\n{"


@pytest.fixture(scope="module")
def plain():
    wire = FakeWire()
    config = ServerConfig(head_s=0.8, body_s=2.0, connections_per_address=12, socket_messages_hz=70.0)
    with running_server(wire, config) as running, telling(wire):
        yield running


@pytest.fixture(scope="module")
def secure(tmp_path_factory):
    access = Access(tls=Tls(*self_signed(tmp_path_factory.mktemp("tls"))))
    with running_server(FakeWire(), ServerConfig(head_s=0.8, body_s=0.8), access) as running:
        yield running


@contextlib.contextmanager
def opened(server):
    """A bare connection, with TLS where the server speaks it."""
    host, port = server.address.rpartition("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as bare:
        if not server.address.startswith("https"):
            yield bare
            return
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        with context.wrap_socket(bare) as wrapped:
            yield wrapped


def heard(connection):
    """What comes until the other side ends it."""
    said = b""
    with contextlib.suppress(ConnectionResetError, ssl.SSLError):
        while piece := connection.recv(65536):
            said += piece
    return said


@pytest.fixture(params=["plain", "secure"])
def either(request):
    return request.getfixturevalue(request.param)


def test_a_head_that_is_half_sent_is_ended_in_time(either):
    with opened(either) as connection:
        connection.sendall(HEAD)
        said = heard(connection)
    assert said.startswith(b"HTTP/1.1 408 ") and b"head did not come in time" in said


def test_a_head_in_small_pieces_has_no_more_time(plain):
    with opened(plain) as connection:
        connection.sendall(HEAD)
        with pytest.raises(OSError):
            for _ in range(300):
                connection.sendall(b"X: 1\r\n")
                time.sleep(0.05)
        assert b"408" in heard(connection)


def test_a_connection_that_says_nothing_is_ended_in_time(either):
    with opened(either) as connection:
        assert heard(connection) == b""


def test_a_tls_handshake_that_is_half_done_is_ended_in_time(secure):
    host, port = secure.address.rpartition("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as connection:
        connection.sendall(b"\x16\x03\x01")
        assert heard(connection) == b""


def test_a_body_that_is_half_sent_is_ended_in_time(either):
    with opened(either) as connection:
        connection.sendall(BODY % either.address.encode())
        said = heard(connection)
    assert said.startswith(b"HTTP/1.1 408 ") and b"body did not come in time" in said


@pytest.mark.long
def test_a_body_goes_on_no_longer_after_an_early_answer(plain):
    with opened(plain) as connection:
        connection.sendall(BODY % b"http://elsewhere.example")
        assert b" 403 " in connection.recv(65536)
        with pytest.raises(OSError):
            for _ in range(90):
                connection.sendall(b"x")
                time.sleep(0.05)


def test_a_long_body_is_not_read_to_its_end(plain):
    with plain.client() as client, opened(plain) as connection:
        head = f"POST /api/arm HTTP/1.1\r\nHost: a\r\nOrigin: {plain.address}\r\nCookie: {plain.cookie(client)}\r\n"
        connection.sendall(f"{head}Content-Length: 1000000000\r\n\r\n".encode())
        sent = 0
        with contextlib.suppress(OSError):
            for _ in range(2000):
                connection.sendall(b"x" * 100_000)
                sent += 100_000
        assert sent < 100_000_000
        assert b" 413 " in heard(connection)


def test_a_request_that_was_broken_off_is_not_carried_out_but_a_stop_is(plain):
    with plain.client(user="ann") as client, contextlib.ExitStack() as stack:

        def half_sent(path):
            head = f"POST {path} HTTP/1.1\r\nHost: a\r\nOrigin: {plain.address}\r\nCookie: {plain.cookie(client)}\r\n"
            connection = stack.enter_context(opened(plain))
            connection.sendall(f"{head}Content-Length: 100\r\n\r\n{{".encode())
            return connection

        plain.wire.asked.clear()
        half_sent("/api/arm").close()
        # The stop does not even wait for its body.
        assert b" 408 " not in heard(half_sent("/api/stop"))
        eventually(lambda: reasons.software_stop("ann", reasons.said("software stop")) in noted(plain))
        assert plain.wire.asked == []


@pytest.mark.parametrize(
    ("path", "others", "code"),
    [
        ("/api/stop", (), b"stop_unconfirmed"),
        ("/robots/rp2/api/stop", ("rp2",), b"stop_unconfirmed"),
        ("/api/stop", ("rp2",), b"stop_of_all_unconfirmed"),
    ],
)
def test_a_stop_that_takes_longer_than_a_body_may_is_answered_all_the_same(path, others, code):
    wire, config = FakeWire(), ServerConfig(body_s=0.3)
    more = {name: FakeWire() for name in others}
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(running_server(wire, config, **more))
        for each in (wire, *more.values()):
            stack.enter_context(telling(each))
        client = stack.enter_context(server.client())
        head = f"POST {path} HTTP/1.1\r\nHost: a\r\nOrigin: {server.address}\r\nCookie: {server.cookie(client)}\r\n"
        with opened(server) as connection:
            connection.sendall(f"{head}Content-Length: 100\r\n\r\n{{".encode())
            assert b'"code":"%s"' % code in heard(connection)


def test_who_keeps_to_the_limits_is_served_beside_those_who_do_not(plain):
    with contextlib.ExitStack() as stack, plain.client(user="ann") as client:
        for _ in range(40):
            stack.enter_context(opened(plain)).sendall(HEAD)
        assert client.get("/api/health").status_code == 200
        with plain.visitor() as newcomer:
            assert newcomer.get("/api/health").status_code == 200
        eventually(lambda: reasons.connection_replaced("127.0.0.1") in noted(plain))


def test_an_address_has_so_many_connections_and_no_more(plain):
    with contextlib.ExitStack() as stack:
        ours = [stack.enter_context(opened(plain)) for _ in range(30)]
        for connection in ours:
            connection.setblocking(False)

        def ended():
            return sum(is_ended(connection) for connection in ours)

        eventually(lambda: ended() >= 18, 0.5)


def is_ended(connection):
    try:
        return connection.recv(1, socket.MSG_PEEK) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


def test_websockets_leave_room_for_requests_and_are_told_why(plain):
    with contextlib.ExitStack() as stack, plain.client(user="zoe") as client:
        pages = [stack.enter_context(plain.socket(client)) for _ in range(9)]
        code, reason = closed(pages[-1])
        assert code == 1013 and "close some" in reason
        assert client.get("/api/me").json()["user"] == "zoe"
        json.loads(pages[0].recv(timeout=PATIENCE_S))


def closed(opened):
    """Code and reason with which the server ends it."""
    eventually(lambda: opened.close_code is not None)
    return opened.close_code, opened.close_reason


PING = '{"type":"Ping","number":1,"rendered":0}'


@pytest.mark.parametrize(("path", "message"), [("/ws", PING), ("/viser", msgspec.msgpack.encode(CAMERA))])
def test_a_socket_that_says_too_much_is_closed_with_the_reason_and_logged_once(plain, path, message):
    with plain.client("viewer", "eve") as eve, plain.socket(eve, path) as flood:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(20_000):
                flood.send(message)
        code, reason = closed(flood)
        cause = reasons.socket_messages_exceeded(70.0)
        assert (code, reason) == (1008, reasons.text_of(cause))
        line = (reasons.page_closed if path == "/ws" else reasons.view_closed)("eve", cause)
        eventually(lambda: noted(plain).count(line) == 1)
        eve.get("/api/events")
        assert noted(plain).count(line) == 1


def test_pings_count_as_messages_do(plain):
    with plain.client("viewer", "ida") as ida, plain.socket(ida) as flood:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(20_000):
                flood.ping()
        assert closed(flood)[0] == 1008


def test_many_bytes_in_few_messages_are_too_much_as_well(plain):
    with plain.client("viewer", "amy") as amy, plain.socket(amy, "/viser") as flood:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(100):
                flood.send(b"x" * 60_000)
        # The frame with code and reason may be lost: TCP resets a connection that is closed with data unread.
        closed(flood)
        cause = reasons.socket_bytes_exceeded(float(ServerConfig().socket_bytes_hz))
        eventually(lambda: reasons.view_closed("amy", cause) in noted(plain))


@pytest.mark.long
def test_a_drag_at_sixty_a_second_is_never_too_much(plain):
    with (
        plain.client(user="pat") as client,
        plain.socket(client) as page,
        plain.socket(client, "/viser") as view,
    ):
        begin = time.monotonic()
        for number in range(150):
            time.sleep(max(0.0, begin + number / 60 - time.monotonic()))
            page.send(PING)
            view.send(msgspec.msgpack.encode(CAMERA))
        assert page.ping().wait(PATIENCE_S) and view.ping().wait(PATIENCE_S)
        client.get("/api/events")
        codes = ("page_closed", "view_closed")
        assert not [line for line in noted(plain) if line.code in codes and ("user", "pat") in line.values]


@pytest.mark.long
def test_one_session_has_a_limit_through_all_of_its_sockets():
    config = ServerConfig(session_messages_hz=60.0)
    with running_server(FakeWire(), config) as server, contextlib.ExitStack() as stack:
        eve, ann = stack.enter_context(server.client("viewer", "eve")), stack.enter_context(server.client(user="ann"))
        pages = [stack.enter_context(server.socket(eve)) for _ in range(4)]
        other = stack.enter_context(server.socket(ann))
        with contextlib.suppress(ConnectionClosed):
            for _ in range(200):
                for page in pages:
                    page.send(PING)
        eventually(lambda: 1008 in [page.close_code for page in pages])
        for _ in range(50):
            other.send(PING)
        assert other.ping().wait(PATIENCE_S)


@pytest.mark.long
def test_who_has_no_session_waits_where_an_address_asks_too_often(monkeypatch):
    for name, value in (("_VISITOR_RATE_HZ", 0.01), ("_VISITOR_BURST", 20.0), ("_MAX_WAIT_S", 0.2)):
        monkeypatch.setattr(f"server.api.middleware.{name}", value)
    with running_server(FakeWire()) as server, server.client() as client, server.visitor() as visitor:
        refused = eventually(lambda: (answer := visitor.get("/api/health")).status_code == 429 and answer, 20.0)
        assert refused.json()["code"] == "visitor_rate_exceeded"
        assert {client.get("/api/me").status_code for _ in range(40)} == {200}
