"""Sign-in over TLS with a password, and with a single-use link; the pages and files that need no session."""

import asyncio
import ssl
import time

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from server.auth.access import Access, Tls
from server.auth.users import UserFile
from tests.support.certificates import self_signed
from tests.support.fake_wire import HEADER, FakeWire, bridge_state
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


@pytest.mark.long
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
        asyncio.run(until_removed(server, users, server.cookie(carl)))
        assert carl.get("/api/me").status_code == 401


async def until_removed(server, users, cookie):
    """One task reads and writes: OpenSSL's connection is not for two threads, as the synchronous client has them."""
    trust = ssl.create_default_context()
    trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
    address, headers = server.socket_address + "/ws", {"cookie": cookie}
    async with connect(address, origin=server.address, additional_headers=headers, ssl=trust, proxy=None) as page:
        await page.recv()
        users.remove("carl")
        removed = time.monotonic()
        with pytest.raises(ConnectionClosed):
            async with asyncio.timeout(5.0):
                while True:
                    await page.recv()
        assert time.monotonic() - removed < 1.5


@pytest.fixture(scope="module")
def link_server():
    with running_server(FakeWire()) as running:
        yield running


@pytest.fixture
def link_visitor(link_server):
    with link_server.visitor() as client:
        client.headers["origin"] = link_server.address
        yield client


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites(link_server, link_visitor):
    answer = link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("ann", "operator")})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert len(cookie.split("=")[1].split(";")[0]) >= 43
    assert link_visitor.get("/api/me").json() == {"user": "ann", "role": "operator"}


def test_looking_at_the_link_does_not_use_it_up(link_server, link_visitor):
    token = link_server.sessions.invite("ann", "operator")
    for _ in range(3):
        assert link_visitor.get(f"/sign-in?token={token}").status_code == 200
        assert "set-cookie" not in link_visitor.get(f"/sign-in?token={token}").headers
    assert link_visitor.post("/api/sign-in", json={"token": token}).status_code == 200


def test_a_link_works_once(link_server, link_visitor):
    token = link_server.sessions.invite("ann", "operator")
    assert link_visitor.post("/api/sign-in", json={"token": token}).status_code == 200
    link_visitor.cookies.clear()
    answer = link_visitor.post("/api/sign-in", json={"token": token})
    assert answer.status_code == 401
    assert "used" in answer.json()["reason"]
    assert link_visitor.get("/api/me").status_code == 401


def test_a_second_link_ends_the_old_session(link_server, link_visitor):
    link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("ann", "operator")})
    old = dict(link_visitor.cookies)
    link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("bob", "viewer")})
    assert link_visitor.get("/api/me").json()["user"] == "bob"
    link_visitor.cookies.clear()
    assert link_visitor.get("/api/me", cookies=None, headers={"cookie": _header(old)}).status_code == 401


def test_signing_out_closes_the_page_at_once(link_server, link_visitor):
    link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("ann", "operator")})
    cookie = _header(link_visitor.cookies)
    with link_server.socket(link_visitor) as page:
        page.recv(timeout=5)
        assert link_visitor.post("/api/sign-out").json()["ok"]
        with pytest.raises(ConnectionClosed):
            for _ in range(100):
                page.recv(timeout=1)
    assert link_visitor.get("/api/me", headers={"cookie": cookie}).status_code == 401


@pytest.mark.long
def test_many_bad_tokens_are_slowed_down_but_the_stop_is_not(link_visitor):
    with running_server(FakeWire()) as own, own.client() as signed_in:
        codes = [signed_in.post("/api/sign-in", json={"token": "guess"}).status_code for _ in range(6)]
        assert codes == [401] * 5 + [429]
        assert signed_in.post("/api/stop", json={"reason": "now"}).status_code in (200, 503)
        assert own.wire.sent[topics.STOP.name]


def test_the_camera_image_is_the_newest_one(link_server, link_visitor):
    link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("ann", "viewer")})
    assert link_visitor.get("/camera/color.jpg").status_code == 404
    for number in (1, 2):
        frame = CameraFrame(
            header=HEADER, sequence=number, intrinsics=Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0),
            base=m.PlanarPose(), position=(0.0,) * 9, color_jpeg=b"jpeg%d" % number, depth_zlib=b"", depth_unit=1e-4,
        )  # fmt: skip
        link_server.wire.deliver(topics.CAMERA, frame)
    answer = link_visitor.get("/camera/color.jpg")
    assert (answer.content, answer.headers["content-type"]) == (b"jpeg2", "image/jpeg")
    assert answer.headers["cache-control"] == "no-store"
    # The page shows the frame that it was told of, whatever has come since.
    assert link_visitor.get("/camera/color.jpg?n=1").content == b"jpeg1"
    assert link_visitor.get("/camera/color.jpg?n=7").status_code == 404


def test_a_visitor_gets_the_sign_in_page_and_a_signed_in_person_the_operators_page(link_server, link_visitor):
    assert 'id="password-form"' in link_visitor.get("/").text
    link_visitor.post("/api/sign-in", json={"token": link_server.sessions.invite("ann", "viewer")})
    assert "<rp-stop>" in link_visitor.get("/").text


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/pyproject.toml", "/..%2fpyproject.toml", "/nothing.js"]
)
def test_no_file_outside_the_page_is_served(link_visitor, path):
    assert link_visitor.get(path).status_code == 404


def _header(cookies):
    return "; ".join(f"{name}={value}" for name, value in cookies.items())
