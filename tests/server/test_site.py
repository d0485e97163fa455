import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from tests.support.fake_wire import HEADER, FakeWire
from tests.support.running_server import running_server


@pytest.fixture(scope="module")
def server():
    with running_server(FakeWire()) as running:
        yield running


@pytest.fixture
def visitor(server):
    with server.visitor() as client:
        client.headers["origin"] = server.address
        yield client


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites(server, visitor):
    answer = visitor.post("/api/sign-in", json={"token": server.sessions.invite("ann", "operator")})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert len(cookie.split("=")[1].split(";")[0]) >= 43
    assert visitor.get("/api/me").json() == {"user": "ann", "role": "operator"}


def test_looking_at_the_link_does_not_use_it_up(server, visitor):
    token = server.sessions.invite("ann", "operator")
    for _ in range(3):
        assert visitor.get(f"/sign-in?token={token}").status_code == 200
        assert "set-cookie" not in visitor.get(f"/sign-in?token={token}").headers
    assert visitor.post("/api/sign-in", json={"token": token}).status_code == 200


def test_a_link_works_once(server, visitor):
    token = server.sessions.invite("ann", "operator")
    assert visitor.post("/api/sign-in", json={"token": token}).status_code == 200
    visitor.cookies.clear()
    answer = visitor.post("/api/sign-in", json={"token": token})
    assert answer.status_code == 401
    assert "used" in answer.json()["reason"]
    assert visitor.get("/api/me").status_code == 401


def test_signing_in_again_ends_the_old_session(server, visitor):
    visitor.post("/api/sign-in", json={"token": server.sessions.invite("ann", "operator")})
    old = dict(visitor.cookies)
    visitor.post("/api/sign-in", json={"token": server.sessions.invite("bob", "viewer")})
    assert visitor.get("/api/me").json()["user"] == "bob"
    visitor.cookies.clear()
    assert visitor.get("/api/me", cookies=None, headers={"cookie": _header(old)}).status_code == 401


def test_signing_out_closes_the_page_at_once(server, visitor):
    visitor.post("/api/sign-in", json={"token": server.sessions.invite("ann", "operator")})
    cookie = _header(visitor.cookies)
    with connect(
        server.socket_address + "/ws", origin=server.address, additional_headers={"cookie": cookie}, proxy=None
    ) as page:
        page.recv(timeout=5)
        assert visitor.post("/api/sign-out").json()["ok"]
        with pytest.raises(ConnectionClosed):
            for _ in range(100):
                page.recv(timeout=1)
    assert visitor.get("/api/me", headers={"cookie": cookie}).status_code == 401


def test_many_bad_tokens_are_slowed_down_but_the_stop_is_not(visitor):
    with running_server(FakeWire()) as own, own.client() as signed_in:
        codes = [signed_in.post("/api/sign-in", json={"token": "guess"}).status_code for _ in range(6)]
        assert codes == [401] * 5 + [429]
        assert signed_in.post("/api/stop", json={"reason": "now"}).status_code in (200, 503)
        assert own.wire.sent[topics.STOP.name]


def test_the_camera_image_is_the_newest_one(server, visitor):
    visitor.post("/api/sign-in", json={"token": server.sessions.invite("ann", "viewer")})
    assert visitor.get("/camera/color.jpg").status_code == 404
    for number in (1, 2):
        frame = CameraFrame(
            header=HEADER, sequence=number, intrinsics=Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0),
            base=m.PlanarPose(), position=(0.0,) * 9, color_jpeg=b"jpeg%d" % number, depth_zlib=b"", depth_unit=1e-4,
        )  # fmt: skip
        server.wire.deliver(topics.CAMERA, frame)
    answer = visitor.get("/camera/color.jpg")
    assert (answer.content, answer.headers["content-type"]) == (b"jpeg2", "image/jpeg")
    assert answer.headers["cache-control"] == "no-store"
    # The page shows the frame that it was told of, whatever has come since.
    assert visitor.get("/camera/color.jpg?n=1").content == b"jpeg1"
    assert visitor.get("/camera/color.jpg?n=7").status_code == 404


def test_a_visitor_gets_the_sign_in_page_and_a_signed_in_person_the_operators_page(server, visitor):
    assert "<title>Sign in" in visitor.get("/").text
    visitor.post("/api/sign-in", json={"token": server.sessions.invite("ann", "viewer")})
    assert "<rp-stop>" in visitor.get("/").text


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/pyproject.toml", "/..%2fpyproject.toml", "/nothing.js"]
)
def test_no_file_outside_the_page_is_served(visitor, path):
    assert visitor.get(path).status_code == 404


def _header(cookies):
    return "; ".join(f"{name}={value}" for name, value in cookies.items())
