"""`rolling-panda status`: who has spoken on the wire, and an exit code for health checks."""

import socket
import threading
from collections.abc import Iterator

import pytest

from rolling_panda import messages as m
from rolling_panda.cli import main as cli
from rolling_panda.config import TransportConfig
from rolling_panda.topics import HEARTBEAT
from rolling_panda.transport.zenoh import Transport

pytestmark = pytest.mark.processes


@pytest.fixture
def perception_loop(endpoint: str) -> Iterator[None]:
    ended = threading.Event()

    def beat() -> None:
        sequence = 0
        while not ended.wait(0.02):
            sequence += 1
            heart.put(m.Heartbeat(process="perception", sequence=sequence))

    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "perception", "rp1") as transport:
        heart = transport.publisher(HEARTBEAT)
        thread = threading.Thread(target=beat)
        thread.start()
        yield
        ended.set()
        thread.join()


def test_a_process_that_speaks_is_up(endpoint: str, perception_loop: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["status", "--plain-wire", "--connect", endpoint, "perception"]) == 0
    assert capsys.readouterr().out == "perception up\n"


def test_one_that_is_silent_makes_it_fail(
    endpoint: str, perception_loop: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["status", "--plain-wire", "--connect", endpoint, "--wait", "0.3"]) == 1
    lines = dict(line.split() for line in capsys.readouterr().out.splitlines())
    assert lines == {"bridge": "silent", "controller": "silent", "perception": "up", "server": "silent"}


def test_being_connected_is_not_being_up(endpoint: str) -> None:
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "server", "rp1"):
        assert cli.main(["status", "--plain-wire", "--connect", endpoint, "--wait", "0.3", "server"]) == 1


@pytest.mark.long
def test_without_a_router_it_says_how_to_name_another(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        assert cli.main(["status", "--plain-wire", "--connect", f"tcp/127.0.0.1:{nobody.getsockname()[1]}"]) == 1
    assert "--connect" in capsys.readouterr().err


def test_an_unknown_process_is_refused_with_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["status", "planner"]) == 1
    assert "planner" in capsys.readouterr().err
