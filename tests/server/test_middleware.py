import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.support.fake_wire import FakeWire
from tests.support.running_server import running_server


@pytest.fixture(scope="module")
def server():
    with running_server(FakeWire()) as running:
        yield running


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example", "https://127.0.0.1:1", "http://127.0.0.1"])
@pytest.mark.parametrize("path", ["/api/stop", "/api/arm", "/api/sign-in", "/api/sign-out", "/no/such/path"])
def test_a_post_from_elsewhere_is_refused_even_with_the_cookie(server, origin, path):
    with server.client() as client:
        del client.headers["origin"]
        headers = {} if origin is None else {"origin": origin}
        answer = client.post(path, json={}, headers=headers)
        assert answer.status_code == 403
        assert answer.json()["ok"] is False
    assert server.wire.asked == []


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example"])
@pytest.mark.parametrize("path", ["/ws", "/viser"])
def test_a_socket_from_elsewhere_is_refused_even_with_the_cookie(server, origin, path):
    with server.client() as client, pytest.raises(InvalidStatus) as caught:
        headers = {"cookie": server.cookie(client)}
        connect(server.socket_address + path, origin=origin, additional_headers=headers, proxy=None)
    assert caught.value.response.status_code == 403


@pytest.mark.parametrize("first", ["page", "elsewhere"])
def test_of_two_origins_neither_counts(server, first):
    origins = [server.address, "http://evil.example"][:: 1 if first == "page" else -1]
    with server.client() as client:
        answer = client.post("/api/arm", json={}, headers=[("origin", origin) for origin in origins])
        assert (answer.status_code, answer.json()["code"]) == (403, "origin_foreign")
        headers = [("cookie", server.cookie(client)), ("origin", origins[1])]
        with pytest.raises(InvalidStatus) as caught:
            connect(server.socket_address + "/ws", origin=origins[0], additional_headers=headers, proxy=None)
        # The library that speaks the protocol may see it first.
        assert caught.value.response.status_code in (400, 403)
    assert server.wire.asked == []


@pytest.mark.parametrize("path", ["/ws", "/viser"])
def test_a_socket_without_a_session_is_refused(server, path):
    with pytest.raises(InvalidStatus) as caught:
        connect(server.socket_address + path, origin=server.address, proxy=None)
    assert caught.value.response.status_code == 403


@pytest.mark.parametrize(
    "path", ["/api/state", "/api/points", "/api/events", "/api/me", "/camera/color.jpg", "/viser/"]
)
def test_reading_needs_a_session(server, path):
    with server.visitor() as visitor:
        answer = visitor.get(path)
        assert answer.status_code == 401
        assert answer.json()["code"] == "not_signed_in"


def test_health_and_version_are_open(server):
    with server.visitor() as visitor:
        assert visitor.get("/api/health").json() == {"status": "ok"}
        assert visitor.get("/version").json()["name"] == "rolling-panda"


@pytest.mark.long
def test_the_description_is_open_but_only_to_be_read(server):
    with server.visitor() as visitor:
        assert visitor.get("/api/openapi.json").status_code == 200
        assert visitor.post("/api/openapi.json", headers={"origin": "http://elsewhere.test"}).status_code == 403


def test_a_long_body_is_refused_however_it_is_sent(server):
    with server.client() as client:
        assert client.post("/api/arm", content=b"x" * 70_000).status_code == 413
        assert client.post("/api/arm", content=iter([b"x" * 40_000, b"x" * 40_000])).status_code == 413


def test_every_answer_has_the_headers_that_keep_browsers_strict(server):
    with server.visitor() as visitor:
        for path in ("/version", "/api/state", "/js/link/messages.js"):
            headers = visitor.get(path).headers
            assert "frame-ancestors 'none'" in headers["content-security-policy"]
            assert "unsafe" not in headers["content-security-policy"]
            assert headers["x-content-type-options"] == "nosniff"


def test_only_the_3d_view_has_the_wider_policy_and_only_our_page_may_frame_it(server):
    with server.client() as client:
        policy = client.get("/viser/").headers["content-security-policy"]
        assert "'unsafe-eval'" in policy
        assert "frame-ancestors 'self'" in policy


def test_refusals_are_in_the_log(server):
    with server.client() as client:
        client.post("/api/arm", headers={"origin": "http://evil.example"})
        texts = [event["text"] for event in client.get("/api/events").json()["events"]]
        assert any("evil.example" in text for text in texts)
