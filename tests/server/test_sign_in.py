"""Signing in with a password over TLS: who knows it gets in, who guesses waits, who is removed is out."""

import ssl
import time

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from rolling_panda import topics
from server.auth.access import Access, Tls
from server.auth.users import UserFile
from tests.support.certificates import self_signed
from tests.support.fake_wire import FakeWire, bridge_state
from tests.support.running_server import eventually, running_server

PASSWORD = "correct horse battery"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("users")


@pytest.fixture(scope="module")
def users(folder):
    file = UserFile(folder / "users.json")
    file.add("ada", "supervisor", PASSWORD)
    return file


@pytest.fixture(scope="module")
def server(folder, users):
    with running_server(FakeWire(), access=Access(users, Tls(*self_signed(folder)))) as running:
        yield running


@pytest.fixture
def visitor(server):
    with server.visitor() as client:
        client.headers["origin"] = server.address
        yield client


def sign_in(visitor, user="ada", password=PASSWORD):
    return visitor.post("/api/sign-in", json={"user": user, "password": password})


def test_the_password_lets_in_with_a_cookie_for_tls_alone(server, visitor):
    assert visitor.get("/api/sign-in").json() == {"password": True}
    answer = sign_in(visitor)
    assert answer.status_code == 200, answer.text
    cookie = answer.headers["set-cookie"].lower()
    assert "secure" in cookie and "httponly" in cookie and "samesite=strict" in cookie
    assert visitor.get("/api/me").json() == {"user": "ada", "role": "supervisor"}
    assert "max-age=" in answer.headers["strict-transport-security"]


def test_each_sign_in_has_a_cookie_of_its_own_and_ends_the_last(server, visitor):
    sign_in(visitor)
    first = server.cookie(visitor)
    sign_in(visitor)
    assert server.cookie(visitor) != first
    visitor.cookies.clear()
    assert visitor.get("/api/me", headers={"cookie": first}).status_code == 401


def test_a_link_lets_nobody_in_and_is_made_for_nobody(server, visitor):
    assert visitor.post("/api/sign-in", json={"token": "a" * 43}).status_code == 401
    sign_in(visitor)
    refused = visitor.post("/api/invite", json={"user": "eve", "role": "supervisor"})
    assert refused.status_code == 403 and "rolling-panda user add" in refused.json()["reason"]


def test_half_a_request_is_refused(visitor):
    for body in ({}, {"user": "ada"}, {"password": PASSWORD}, {"token": "a", "user": "ada", "password": PASSWORD}):
        answer = visitor.post("/api/sign-in", json=body)
        assert answer.status_code == 422, body


def test_who_guesses_waits_and_who_is_in_can_stop_meanwhile(server, users):
    users.add("bob", "operator", PASSWORD)
    wire = server.wire
    with server.visitor() as bob, server.visitor() as eve:
        for client in (bob, eve):
            client.headers["origin"] = server.address
        assert sign_in(bob, "bob").status_code == 200
        statuses = [sign_in(eve, "bob", f"guess number {n}").status_code for n in range(6)]
        assert statuses == [401] * 5 + [429]
        refused = sign_in(eve, "bob")
        assert refused.status_code == 429 and int(refused.headers["retry-after"]) >= 1
        wire.deliver(topics.BRIDGE, bridge_state("s"))
        stopped = bob.post("/api/stop", json={"reason": "eve is guessing"})
        assert stopped.status_code in (200, 503) and wire.sent["command/stop"]
        time.sleep(1.2)
        assert sign_in(eve, "bob").status_code == 200


def test_who_is_removed_is_out_within_a_second(server, users):
    users.add("carl", "operator", PASSWORD)
    with server.visitor() as carl:
        carl.headers["origin"] = server.address
        assert eventually(lambda: sign_in(carl, "carl").status_code == 200)
        trust = ssl.create_default_context()
        trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
        with connect(
            server.socket_address + "/ws",
            ssl=trust,
            origin=server.address,
            additional_headers={"cookie": server.cookie(carl)},
            proxy=None,
        ) as page:
            page.recv(timeout=5)
            users.remove("carl")
            removed = time.monotonic()
            with pytest.raises(ConnectionClosed):
                while time.monotonic() < removed + 5.0:
                    page.recv(timeout=5)
            assert time.monotonic() - removed < 1.5
        assert carl.get("/api/me").status_code == 401
