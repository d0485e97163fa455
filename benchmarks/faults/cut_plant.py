"""Blades and plant that outlive every process of the robot.

Started as `python -m benchmarks.faults.cut_plant SOCKET RECORD CLOSE_S`. The bridge under test speaks to them over a
socket, so that blades that have begun to close go on when the bridge is killed or stands still, as steel does. `RECORD`
says what really happened, a line of JSON each: `closing` when blades begin, `bite` when they have met, `opened` when
they were told to open before that. Nothing else in a trial is believed.
"""

import json
import os
import select
import socket
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until standard input closes."""
    address, record, close_s = (sys.argv[1:] if argv is None else list(argv))[:3]
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(address)
        door.listen()
        print("up", flush=True)
        _Plant(door, Path(record), float(close_s)).run()
    return 0


class _Plant:
    """One pair of blades, and whoever is connected now."""

    def __init__(self, door: socket.socket, record: Path, close_s: float) -> None:
        self._door, self._close_s = door, close_s
        self._file = os.open(record, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        self._bridge: socket.socket | None = None
        self._rest = b""
        self._cut: dict[str, Any] | None = None
        self._meet_at = 0.0

    def run(self) -> None:
        """Close, bite and tell."""
        while True:
            waiting = [self._door, sys.stdin, *([] if self._bridge is None else [self._bridge])]
            left = 1.0 if self._cut is None else max(self._meet_at - time.monotonic(), 0.0)
            for one in select.select(waiting, [], [], left)[0]:
                if one is sys.stdin:
                    return
                if one is self._door:
                    self._welcome()
                else:
                    self._listen()
            if self._cut is not None and time.monotonic() >= self._meet_at:
                self._end("bite", "DONE")

    def _welcome(self) -> None:
        if self._bridge is not None:
            self._bridge.close()
        self._bridge, _ = self._door.accept()
        self._rest = b""

    def _listen(self) -> None:
        assert self._bridge is not None
        try:
            data = self._bridge.recv(4096)
        except OSError:
            data = b""
        if not data:
            # The bridge is gone. The blades are not.
            self._bridge.close()
            self._bridge = None
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            order = json.loads(line)
            if order["order"] == "cut" and self._cut is None:
                self._cut, self._meet_at = order, time.monotonic() + self._close_s
                self._write("closing")
            elif order["order"] == "open" and self._cut is not None:
                self._end("opened", "FAILED_NOT_CUT")

    def _end(self, event: str, outcome: str) -> None:
        assert self._cut is not None
        self._write(event)
        told = json.dumps({"cut_id": self._cut["cut_id"], "outcome": outcome}).encode() + b"\n"
        self._cut = None
        if self._bridge is not None:
            try:
                self._bridge.sendall(told)
            except OSError:
                return

    def _write(self, event: str) -> None:
        assert self._cut is not None
        cut = {name: self._cut[name] for name in ("cut_id", "point_id")}
        line = {"event": event, **cut, "at": time.monotonic()}
        os.write(self._file, json.dumps(line).encode() + b"\n")


if __name__ == "__main__":
    sys.exit(main())
