"""`rolling-panda replay FILE`: play a recording on the operator's page until Ctrl-C. Nothing moves."""

import argparse
import secrets
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from recorder.cut_pictures import keep_pictures
from recorder.player import Player, is_played
from recorder.recording import read_recording
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.cli.child_processes import ChildProcesses
from rolling_panda.cli.demo import choose_router_port, write_secret
from rolling_panda.closing import Closing
from rolling_panda.commands import SeekReplay
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.runtime.launch import python_command
from rolling_panda.runtime.process import ROBOT_ID, stop_on_signals
from rolling_panda.topics import TOPICS
from rolling_panda.transport.certificates import make
from rolling_panda.transport.settings import DEFAULT_ENDPOINT
from rolling_panda.transport.zenoh import Router, Transport

_HOST = "127.0.0.1"
_PERIOD_S, _STATE_PERIOD_S = 0.01, 0.1
_REFUSED = m.Answer(ok=False, reason=reasons.recording_only())
#: Processes that the replay stands in for.
_REPLAYED: tuple[m.Process, ...] = ("bridge", "controller", "perception")


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
    recording = read_recording(arguments.file)
    if not recording.complete:
        print(f"{arguments.file} is incomplete: its recorder was killed", flush=True)
    endpoint = f"tls/{_HOST}:{choose_router_port(DEFAULT_ENDPOINT)}"
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rolling-panda-")))
        certificates = str(folder / "certificates")
        make(folder / "certificates", (_HOST,), None)
        wire = TransportConfig(connect=(endpoint,), certificates=certificates)
        router = replace(wire, mode="router", connect=(), listen=(endpoint,))
        stack.callback(Router(router).close)
        keep_pictures(recording, folder / "pictures" / ROBOT_ID)
        replay = stack.enter_context(Replay(wire, Player(recording, arguments.file.name, time.monotonic())))
        children = ChildProcesses(folder)
        stack.callback(children.end)
        token, token_file = secrets.token_urlsafe(32), folder / "sign-in-token"
        write_secret(token_file, token)
        options = ["--connect", endpoint, "--certificates", certificates, "--port", str(arguments.port)]
        options += ["--sign-in-token-file", str(token_file), "--state", str(folder), "--exit-with-parent"]
        children.start("server", python_command("server", options))
        page = f"http://127.0.0.1:{arguments.port}"
        print(f"{arguments.file}: {recording.duration_s:.0f} s, {len(recording.messages)} messages", flush=True)
        link_due = True
        while not stopping.wait(_PERIOD_S):
            replay.step(time.monotonic())
            exited = children.exited()
            if exited is not None:
                raise InputError(f"the page's server ended {exited.cause}: {exited.output}")
            # Not before there is somebody to open it.
            if link_due and _answers(arguments.port):
                print(
                    f"\nSign in once with this link, on this machine:\n\n    {page}/sign-in?token={token}\n", flush=True
                )
                link_due = False
    return 0


def _answers(port: int) -> bool:
    """Whether somebody listens there."""
    try:
        socket.create_connection((_HOST, port), 1.0).close()
    except OSError:
        return False
    return True


class Replay(Closing):
    """Publishes a recording in place of the recorded processes, and refuses requests to them."""

    def __init__(self, config: TransportConfig, player: Player) -> None:
        """Advertise the topics and services of the recorded processes."""
        self._player, self._lock = player, threading.Lock()
        self._wires = {process: Transport(config, process, ROBOT_ID) for process in _REPLAYED}
        self._publishers: dict[str, Any] = {}
        for topic in TOPICS:
            if is_played(topic):
                wires = [wire for process, wire in self._wires.items() if process == topic.sender]
                self._publishers[topic.name] = (wires or [self._wires["bridge"]])[0].publisher(topic)
        controller = self._wires["controller"]
        self._state, self._timeline = controller.publisher(topics.REPLAY), controller.publisher(topics.TIMELINE)
        controller.serve(topics.SEEK, self._seek)
        controller.serve(topics.INTENT, lambda request: _REFUSED)
        self._wires["perception"].serve(topics.PLANT, lambda request: _REFUSED)
        self._state_sent = self._timeline_sent = float("-inf")

    def close(self) -> None:
        """Close the connections."""
        for wire in self._wires.values():
            wire.close()

    def step(self, now: float) -> None:
        """Publish the messages that are due."""
        with self._lock:
            due, state = self._player.step(now), self._player.state
        for recorded in due:
            self._publishers[recorded.topic.name].put(recorded.message())
        if now - self._state_sent >= _STATE_PERIOD_S:
            self._state_sent = now
            self._state.put(state)
        if now - self._timeline_sent >= 1.0 / topics.TIMELINE.rate_hz:
            self._timeline_sent = now
            self._timeline.put(self._player.timeline)

    def _seek(self, request: SeekReplay) -> m.Answer:
        with self._lock:
            self._player.seek(request)
        return m.Answer(ok=True)


if __name__ == "__main__":
    sys.exit(main())
