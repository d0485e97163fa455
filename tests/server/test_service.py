import argparse
import socket
import threading

import pytest

from rolling_panda.errors import InputError
from rolling_panda.resources import resource
from rolling_panda.runtime.process import ProcessContext
from server import service
from server.__main__ import add_arguments
from server.service import listen
from tests.support.fake_wire import FakeWire
from tests.support.running_server import running_server


def test_a_port_in_use_is_one_clear_line():
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=rf"cannot listen on 127.0.0.1:{port}: .*--port"):
            listen("127.0.0.1", port)


def test_a_port_that_is_no_port_is_one_clear_line():
    with pytest.raises(InputError, match="cannot listen"):
        listen("127.0.0.1", 70_000)


def test_no_part_of_an_answer_waits_for_the_other_side():
    with listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        answering, _ = listener.accept()
        with answering:
            assert answering.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def context(*argv):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    parser.set_defaults(robot_id="rp1", config=resource("assets/config/sim.toml"), connect=None)
    parser.set_defaults(certificates=None, plain_wire=False, state=None)
    return ProcessContext(parser.parse_args(argv), resource("assets/config/sim.toml"), FakeWire(), threading.Event())


@pytest.fixture
def served(monkeypatch):
    """Instead of serving, hand over what would have been served."""
    seen = {}

    async def serve(config, wires, sessions, listener, stopping, allowed, built, state):
        seen.update(robots=list(wires), sessions=sessions, allowed=allowed, port=listener.getsockname()[1])

    monkeypatch.setattr(service, "serve", serve)
    return seen


def test_the_token_file_is_used_and_deleted(served, tmp_path, capsys):
    file = tmp_path / "token"
    file.write_text("a" * 43)
    service.run(context("--port", "0", "--sign-in-token-file", str(file)))
    assert not file.exists()
    assert served["sessions"].sign_in("a" * 43, 0.0).role == "supervisor"
    assert "a" * 43 not in capsys.readouterr().out


def test_without_a_file_one_link_is_printed_and_works(served, capsys):
    service.run(context("--port", "0"))
    link = capsys.readouterr().out.split()[-1]
    address, token = link.split("/sign-in?token=")
    assert address == f"http://127.0.0.1:{served['port']}"
    assert served["sessions"].sign_in(token, 0.0).role == "supervisor"


def test_a_weak_or_missing_token_is_refused(served, tmp_path):
    with pytest.raises(InputError, match="token file"):
        service.run(context("--port", "0", "--sign-in-token-file", str(tmp_path / "none")))
    weak = tmp_path / "weak"
    weak.write_text("1234")
    with pytest.raises(InputError, match="128 bits"):
        service.run(context("--port", "0", "--sign-in-token-file", str(weak)))


@pytest.mark.parametrize("names", [["rp1"], ["a/b"], [""], ["two words"], ["*"], ["rp2", "rp2"]])
def test_a_robots_name_is_part_of_a_path_and_there_once(served, names):
    with pytest.raises(InputError, match="cannot be called|given twice"):
        service.run(context("--port", "0", *(f"--also-robot-id={name}" for name in names)))


def test_several_robots_are_on_wires_of_their_own(served, monkeypatch):
    opened = []

    class Wire(FakeWire):
        def __init__(self, config, process, robot_id):
            super().__init__()
            opened.append((process, robot_id))

        def __enter__(self):
            return self

        def __exit__(self, *_):
            opened.append("closed")

    monkeypatch.setattr(service, "Transport", Wire)
    service.run(context("--port", "0", "--also-robot-id", "rp2"))
    assert served["robots"] == ["rp1", "rp2"]
    assert opened == [("server", "rp2"), "closed"]


def test_with_several_robots_each_has_certificates_of_its_own(served, tmp_path):
    given = context("--port", "0", "--also-robot-id", "rp2")
    given.arguments.certificates = tmp_path
    (tmp_path / "rp1").mkdir()
    with pytest.raises(InputError, match="no folder .*rp2.*certificates --out DIR --robot rp1 --robot rp2"):
        service.run(given)


@pytest.mark.long
@pytest.mark.parametrize("plain", [True, False])
def test_a_plain_wire_is_shown_and_logged(plain):
    wire = FakeWire()
    wire.plain = plain
    with running_server(wire) as server, server.client() as client:
        assert client.get("/api/state").json()["plain_wire"] is plain
        told = [(line["severity"], line["text"]) for line in client.get("/api/events").json()["events"]]
        assert [severity for severity, text in told if "wire is plain" in text] == (["error"] if plain else [])
