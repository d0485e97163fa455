"""`rolling-panda replay FILE`: a recording on the operator's page, with a scrubber, until Ctrl-C. Nothing moves."""

import argparse
import secrets
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from recorder.player import Player, played
from recorder.tape import read_tape
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.cli.demo import choose_router_port, write_secret
from rolling_panda.cli.demo_supervisor import Supervisor
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.messages.commands import SeekReplay
from rolling_panda.runtime.launch import python_command
from rolling_panda.runtime.process import ROBOT_ID, stop_on_signals
from rolling_panda.topics import TOPICS
from rolling_panda.transport.certificates import make
from rolling_panda.transport.settings import DEFAULT_ENDPOINT
from rolling_panda.transport.zenoh import Router, Transport

_HOST = "127.0.0.1"
_PERIOD_S = 0.01
_STATE_S = 0.1
_REFUSAL = m.Answer(ok=False, reason="this is a recording; nothing can be asked of the robot")
# Who told what is played.
_ABSENT: tuple[m.Process, ...] = ("bridge", "controller", "perception")


def main(argv: Sequence[str] | None = None) -> int:
    """Replay; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda replay", description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="MCAP file of `rolling-panda record`")
    parser.add_argument("--port", type=int, default=8000, help="port of the page (default: %(default)s)")
    arguments = parser.parse_args(argv)
    try:
        return _run(arguments, stop_on_signals())
    except RollingPandaError as error:
        print(f"rolling-panda replay: {error}", file=sys.stderr)
        return 1


def _run(arguments: argparse.Namespace, stopping: threading.Event) -> int:
    tape = read_tape(arguments.file)
    if not tape.whole:
        print(f"{arguments.file} ends in the middle: its recorder was killed", flush=True)
    endpoint = f"tls/{_HOST}:{choose_router_port(DEFAULT_ENDPOINT)}"
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rolling-panda-")))
        certificates = str(folder / "certificates")
        make(folder / "certificates", (_HOST,), None)
        wire = TransportConfig(connect=(endpoint,), certificates=certificates)
        router = replace(wire, mode="router", connect=(), listen=(endpoint,))
        stack.callback(Router(router).close)
        stage = stack.enter_context(Stage(wire, Player(tape, arguments.file.name, time.monotonic())))
        supervisor = Supervisor(folder)
        stack.callback(supervisor.end)
        token, token_file = secrets.token_urlsafe(32), folder / "sign-in-token"
        write_secret(token_file, token)
        words = ["--connect", endpoint, "--certificates", certificates, "--port", str(arguments.port)]
        words += ["--sign-in-token-file", str(token_file), "--state", str(folder), "--exit-with-parent"]
        supervisor.start("server", python_command("server", words))
        page = f"http://127.0.0.1:{arguments.port}"
        print(f"{arguments.file}: {tape.duration_s:.0f} s, {len(tape.rows)} messages", flush=True)
        print(f"\nSign in once with this link, on this machine:\n\n    {page}/sign-in?token={token}\n", flush=True)
        while not stopping.wait(_PERIOD_S):
            stage.step(time.monotonic())
            death = supervisor.death()
            if death is not None:
                raise InputError(f"the page's server ended {death.how}: {death.tail}")
    return 0


class Stage:
    """The wire on which a player stands in for those who were recorded."""

    def __init__(self, config: TransportConfig, player: Player) -> None:
        """Announce them, and refuse what is asked of them."""
        self._player, self._lock = player, threading.Lock()
        self._wires = {process: Transport(config, process, ROBOT_ID) for process in _ABSENT}
        self._put: dict[str, Any] = {}
        for topic in TOPICS:
            if played(topic):
                wire = next(
                    (self._wires[process] for process in _ABSENT if process == topic.sender), self._wires["bridge"]
                )
                self._put[topic.name] = wire.publisher(topic)
        own = self._wires["controller"]
        self._state = own.publisher(topics.REPLAY)
        own.serve(topics.SEEK, self._seek)
        own.serve(topics.INTENT, lambda request: _REFUSAL)
        self._wires["perception"].serve(topics.PLANT, lambda request: _REFUSAL)
        self._told = float("-inf")

    def __enter__(self) -> "Stage":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        for wire in self._wires.values():
            wire.close()

    def step(self, now: float) -> None:
        """Tell what is due."""
        with self._lock:
            due, state = self._player.step(now), self._player.state
        for row in due:
            self._put[row.topic.name].put(row.message())
        if now - self._told >= _STATE_S:
            self._told = now
            self._state.put(state)

    def _seek(self, request: SeekReplay) -> m.Answer:
        with self._lock:
            self._player.seek(request)
        return m.Answer(ok=True)


if __name__ == "__main__":
    sys.exit(main())
