"""Somebody with a client written from docs/wire.md, beside a demo on the same machine: nothing is read or said.

Nothing of the program's own wire is imported here: topics and services are those that the document lists.
"""

import json
import os
import re
import shutil
import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from bridge.sim.robot.trace import read
from rolling_panda.transport.certificates import make
from tests.support.processes.demo import TracedDemo, running_demo

pytestmark = pytest.mark.paced

DOCUMENT = (Path(__file__).resolve().parents[2] / "docs/wire.md").read_text()
ROOT = "rp/rp1/" + re.findall(r"`(v\d+)` is the schema version", DOCUMENT)[0]
#: Long enough for an answer over loopback, and for ten of the bridge's states.
LISTEN_S = 0.5


def listed(block: str) -> list[str]:
    """What the document's table of that name lists."""
    found = re.search(rf"<!-- generated: {block} -->(.*?)<!-- end -->", DOCUMENT, re.DOTALL)
    assert found is not None
    return re.findall(r"^\| `([a-z/-]+)` \|", found[1], re.MULTILINE)


TOPICS, SERVICES = listed("topics"), listed("services")

#: The worst that an outsider could say where the document is all they have.
SAID: dict[str, list[dict[str, Any]]] = {
    "command/motion": [
        {"type": "MotionCommand", "epoch": epoch, "sequence": 1, "echo": 0, "xi": [0.5] * 9, "token": "mine"}
        for epoch in (0, 1, 2, 2**62)
    ],
    "command/token": [{"type": "TokenRequest", "token": "mine", "echo": 0, "mode": "AUTO"}],
    "command/stop": [{"type": "StopRequest", "stop_id": "outside", "source": "x", "user": "eve", "reason": "because"}],
    "simulation/hardware-stop": [{"type": "HardwareStop", "pressed": True}],
    "service/intent": [{"type": "Arm", "user": "eve", "role": "supervisor"}],
    "service/release": [{"type": "ReleaseStop", "stop_id": "outside", "user": "eve", "reason": "because"}],
}


def outsiders(folder: Path, port: int) -> dict[str, dict[str, Any]]:
    """Zenoh's settings of everybody who tries, by what they try; `ca.pem` is taken as known, since it is no secret."""
    (authority,) = folder.rglob("rolling-panda-*/certificates/ca.pem")
    make(folder / "own", ("127.0.0.1",), 2)
    (folder / "forged").mkdir()
    for name in ("controller.pem", "controller.key"):
        shutil.copy(folder / "own" / name, folder / "forged")
    shutil.copy(authority, folder / "forged/ca.pem")
    client = {"mode": "client", "connect/timeout_ms": 1500, "connect/exit_on_failure": True}
    quiet = {"scouting/multicast/enabled": False}
    tls = client | quiet | {"connect/endpoints": [f"tls/127.0.0.1:{port}"]}

    def shown(certificates: Path, name: str) -> dict[str, Any]:
        return {
            "transport/link/tls/root_ca_certificate": str(certificates / "ca.pem"),
            "transport/link/tls/connect_certificate": str(certificates / f"{name}.pem"),
            "transport/link/tls/connect_private_key": str(certificates / f"{name}.key"),
            "transport/link/tls/enable_mtls": True,
        }

    return {
        "plain TCP": client | quiet | {"connect/endpoints": [f"tcp/127.0.0.1:{port}"]},
        "TLS without a certificate": tls | {"transport/link/tls/root_ca_certificate": str(authority)},
        "a certificate of their own authority": tls | shown(folder / "own", "controller"),
        "the controller's name on a certificate of their own": tls | shown(folder / "forged", "controller"),
        "QUIC": client | quiet | {"connect/endpoints": [f"quic/127.0.0.1:{port}"]},
        "a look around": {"mode": "peer"},
        # Not one of them: whether this client would hear anything at all.
        "onlooker": tls | shown(authority.parent, "onlooker"),
    }


def opened(settings: dict[str, Any]) -> zenoh.Session | None:
    config = zenoh.Config()
    for path, value in settings.items():
        config.insert_json5(path, json.dumps(value))
    with suppress(zenoh.ZError):
        return zenoh.open(config)
    return None


def tried(settings: dict[str, Any]) -> set[str]:
    """Everything that somebody has heard or been answered, who says on every key what would do harm."""
    session = opened(settings)
    if session is None:
        return set()
    heard: set[str] = set()
    with session:
        for where in (*(f"{ROOT}/{name}" for name in TOPICS), f"{ROOT}/**", "**"):
            session.declare_subscriber(where, lambda sample: heard.add(str(sample.key_expr)))
        there = session.liveliness()
        there.declare_subscriber("rp/**", lambda sample: heard.add(str(sample.key_expr)), history=True)
        time.sleep(LISTEN_S)
        own = frozenset(heard)
        for name in TOPICS:
            for said in SAID.get(name, [{"type": "Heartbeat", "process": "server", "sequence": 1}]):
                session.put(f"{ROOT}/{name}", msgspec.msgpack.encode(said), express=True)
        answers = []
        for name in (*SERVICES, "**"):
            for request in SAID.get(name, [{}]):
                replies = session.get(f"{ROOT}/{name}", payload=msgspec.msgpack.encode(request), timeout=LISTEN_S)
                answers += [name for reply in replies if reply.ok is not None]
    return {*own, *answers}


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TracedDemo]:
    folder = tmp_path_factory.mktemp("demo")
    with running_demo(folder) as demo:
        yield demo


def port_of(demo: TracedDemo) -> int:
    found = re.search(r"wire is at \w+/127\.0\.0\.1:(\d+):", demo.text())
    assert found is not None, demo.text()
    return int(found[1])


@pytest.mark.long
def test_whoever_has_no_certificate_of_this_run_reads_nothing_and_moves_nothing(demo: TracedDemo) -> None:
    assert len(TOPICS) > 20 and len(SERVICES) > 3
    ways = outsiders(demo.trace.parent, port_of(demo))
    # The same client is told what it may hear, so silence is a refusal.
    assert f"{ROOT}/state/bridge" in tried(ways.pop("onlooker"))
    assert {way: sorted(tried(settings)) for way, settings in ways.items()} == {way: [] for way in ways}
    trace = read(demo.trace)
    assert not np.abs(trace.rows["base_velocity"]).max() > 1e-3
    assert not [event for event in trace.events if event["event"] == "cut"]


@pytest.mark.long
def test_a_bare_connection_is_told_nothing(demo: TracedDemo) -> None:
    """The bytes that come back are those of TLS's own refusal, at most."""
    with socket.create_connection(("127.0.0.1", port_of(demo)), timeout=5) as plain:
        plain.sendall(b"\x00" * 64)
        plain.settimeout(2)
        with suppress(TimeoutError, ConnectionError):
            # A record of the type alert, or nothing.
            assert plain.recv(4096)[:1] in (b"", b"\x15")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with (
        pytest.raises((ssl.SSLError, ConnectionError)),
        socket.create_connection(("127.0.0.1", port_of(demo)), timeout=5) as bare,
        context.wrap_socket(bare) as secure,
    ):
        secure.sendall(b"\x00" * 64)
        assert secure.recv(4096) == b""
        raise ConnectionError("closed without a word")


@pytest.mark.long
def test_the_keys_of_the_run_are_for_this_user_alone(demo: TracedDemo) -> None:
    (folder,) = demo.trace.parent.glob("rolling-panda-*/certificates")
    assert folder.stat().st_mode & 0o777 == 0o700 and folder.stat().st_uid == os.getuid()
    keys = list(folder.rglob("*.key"))
    assert keys and all(key.stat().st_mode & 0o777 == 0o600 for key in keys)
    assert not list(folder.rglob("ca.key"))
