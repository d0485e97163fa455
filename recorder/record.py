"""`rolling-panda record`: write down all that is on the robot's wire, until Ctrl-C."""

import argparse
import queue
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from recorder.recording import Recording
from rolling_panda import messages as m
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.priority import take_priority
from rolling_panda.runtime.process import add_common_arguments, end_with_parent, stop_on_signals, wire_config
from rolling_panda.topics import TOPICS, Topic
from rolling_panda.transport.access import RECORDER
from rolling_panda.transport.zenoh import Onlooker

# Twice as often as a killed recorder may lose.
_FLUSH_S = 0.4
_POLL_S = 0.05
# Some seconds of everything: a disk that stalls for longer costs the newest.
_WAITING = 20_000

Waiting = queue.Queue[tuple[Topic[Any], m.Message, int]]


def main(argv: Sequence[str] | None = None) -> int:
    """Record; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda record", description=__doc__)
    add_common_arguments(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="MCAP file to write; Foxglove opens it")
    arguments = parser.parse_args(argv)
    stopping = stop_on_signals()
    if arguments.exit_with_parent:
        end_with_parent(stopping)
    # The robot comes first.
    take_priority("background")
    try:
        with Onlooker(wire_config(arguments), arguments.robot_id, RECORDER) as wire:
            count, lost = record(wire, arguments.out, stopping)
    except RollingPandaError as error:
        print(f"rolling-panda record: {error}", file=sys.stderr)
        return 1
    print(f"{count} messages in {arguments.out}" + (f", {lost} more were lost" if lost else ""), flush=True)
    return 0


def record(wire: Onlooker, path: Path, stopping: threading.Event) -> tuple[int, int]:
    """Record until `stopping` is set: how many messages were written, and how many came too fast for that.

    Raises:
        InputError: The file cannot be written.
    """
    recording = Recording(path, wire.robot_id)
    waiting: Waiting = queue.Queue(_WAITING)
    lost = 0

    def taker(topic: Topic[Any]) -> Any:
        def take(message: m.Message, at: float) -> None:
            nonlocal lost
            try:
                waiting.put_nowait((topic, message, time.time_ns() - round(1e9 * (time.monotonic() - at))))
            except queue.Full:
                lost += 1

        return take

    for topic in TOPICS:
        wire.subscribe(topic, taker(topic))
    print(f"recording to {path}", flush=True)
    try:
        flushed = time.monotonic()
        while not stopping.wait(_POLL_S):
            _write(recording, waiting)
            if time.monotonic() - flushed >= _FLUSH_S:
                recording.flush()
                flushed = time.monotonic()
    finally:
        _write(recording, waiting)
        recording.close()
    return recording.messages, lost


def _write(recording: Recording, waiting: Waiting) -> None:
    for _ in range(waiting.qsize()):
        recording.add(*waiting.get_nowait())


if __name__ == "__main__":
    sys.exit(main())
