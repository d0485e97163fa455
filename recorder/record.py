"""`rolling-panda record`: record all messages of a robot until Ctrl-C."""

import argparse
import functools
import queue
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from recorder.recording import RecordingWriter
from rolling_panda import messages as m
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.process import add_common_arguments, end_with_parent, stop_on_signals, wire_config
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.topics import TOPICS, Topic
from rolling_panda.transport.access import RECORDER
from rolling_panda.transport.zenoh import Onlooker

#: A killed recorder loses up to twice this.
_FLUSH_PERIOD_S = 0.4
_POLL_S = 0.05
#: Several seconds of all messages: a longer stall of the disk drops the newest.
_QUEUE_SIZE = 20_000

MessageQueue = queue.Queue[tuple[Topic[Any], m.Message, int]]


def main(argv: Sequence[str] | None = None) -> int:
    """Record; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda record", description=__doc__)
    add_common_arguments(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="MCAP file to write; Foxglove opens it")
    arguments = parser.parse_args(argv)
    stopping = stop_on_signals()
    if arguments.exit_with_parent:
        end_with_parent(stopping)
    set_priority("background")
    try:
        with Onlooker(wire_config(arguments), arguments.robot_id, RECORDER) as wire:
            count, dropped = record(wire, arguments.out, stopping)
    except RollingPandaError as error:
        print(f"rolling-panda record: {error}", file=sys.stderr)
        return 1
    print(f"{count} messages in {arguments.out}" + (f", {dropped} dropped" if dropped else ""), flush=True)
    return 0


def record(wire: Onlooker, path: Path, stopping: threading.Event) -> tuple[int, int]:
    """Record until `stopping` is set; returns the numbers of messages written and dropped.

    Raises:
        InputError: The file cannot be written.
    """
    writer = RecordingWriter(path, wire.robot_id)
    messages: MessageQueue = queue.Queue(_QUEUE_SIZE)
    dropped = 0
    # Read once: with a reading for each message, a thread held up between the two clocks, or a clock that is set, would
    # change the order of messages.
    epoch_ns = time.time_ns() - time.monotonic_ns()

    def enqueue(topic: Topic[Any], message: m.Message, received_at: float) -> None:
        nonlocal dropped
        try:
            messages.put_nowait((topic, message, epoch_ns + round(1e9 * received_at)))
        except queue.Full:
            dropped += 1

    for topic in TOPICS:
        wire.subscribe(topic, functools.partial(enqueue, topic))
    print(f"recording to {path}", flush=True)
    try:
        flushed = time.monotonic()
        while not stopping.wait(_POLL_S):
            _write(writer, messages)
            if time.monotonic() - flushed >= _FLUSH_PERIOD_S:
                writer.flush()
                flushed = time.monotonic()
    finally:
        _write(writer, messages)
        writer.close()
    return writer.message_count, dropped


def _write(writer: RecordingWriter, messages: MessageQueue) -> None:
    for _ in range(messages.qsize()):
        writer.write(*messages.get_nowait())


if __name__ == "__main__":
    sys.exit(main())
