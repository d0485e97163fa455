"""Trace of the simulated actuators: one row for each physics step, and one event for each cut.

The file is a sequence of blocks: one letter, a length (uint32, little-endian), and the data. `H` is JSON with the
fields of a row, `R` is rows, `E` is one event in JSON. A block is written every 100 steps, the most that a killed
bridge loses; an incomplete last block is ignored.
"""

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rolling_panda.closing import Closing
from rolling_panda.errors import ConfigError, InputError

#: Fields of a row. Velocities are true ones, not measured ones; `setpoint` is what the servos were given.
ROW = np.dtype(
    [
        ("time", "<f8"),  # simulated time at the end of the step (s)
        ("clock", "<f8"),  # the bridge's clock when the step was asked for (s): monotonic in a running bridge
        ("base", "<f8", 3),  # true x, y (m) and heading (rad, not wrapped) of base_link in the world
        ("base_velocity", "<f8", 3),  # true velocity of base_link along its x and y (m/s), yaw rate (rad/s)
        ("position", "<f8", 9),  # θ_l, θ_r, q₁…q₇ (rad)
        ("velocity", "<f8", 9),  # rad/s
        ("setpoint", "<f8", 9),  # ξ̇ sent to the servos (rad/s)
        ("tool", "<f8", 3),  # true position of the tool in the world (m)
        ("epoch", "<u8"),  # token of the command that the setpoint follows from
        ("sequence", "<i8"),  # -1 before the first command
        ("cutter", "u1"),  # index in CUTTER
        ("contacts", "<u2"),  # contacts of the robot with posts, trunks, cordons and wires
        ("self_contacts", "<u2"),  # contacts of arm and tool with each other and with the base
        ("touch", "<f4"),  # sum of the forces between robot and row, those of elastic canes included (N)
    ]
)
CUTTER = ("open", "closing", "opening", "jammed")
#: Speeds below which the robot is at rest (m/s, rad/s).
_STANDSTILL = 0.01
_ROWS_PER_BLOCK = 100
_BLOCK_HEADER = struct.Struct("<cI")


@dataclass(frozen=True)
class Trace:
    """A trace in memory: `rows` with the fields of `ROW`, and `events` in order."""

    rows: NDArray[Any]
    events: tuple[dict[str, Any], ...]

    def stopping_time(self, clock: float) -> float:
        """Simulated time (s) from a fault at `clock` (s, the bridge's clock) to standstill; infinite without it."""
        after = self.rows[self.rows["clock"] >= clock]
        speeds = np.abs(np.hstack([after["base_velocity"], after["velocity"][:, 2:]]))
        moving = speeds.max(axis=1, initial=0.0) > _STANDSTILL
        last = np.flatnonzero(moving)
        if len(after) == 0 or (len(last) and last[-1] == len(after) - 1):
            return float("inf")
        return float(after["time"][last[-1] + 1] - after["time"][0]) if len(last) else 0.0


class TraceWriter(Closing):
    """Writes a trace. Fill `row` and call `commit` for each step."""

    def __init__(self, path: Path) -> None:
        """Create the file, or replace it.

        Raises:
            ConfigError: The file cannot be written.
        """
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise ConfigError(f"cannot write the trace {path}: {error.strerror}") from error
        self._rows = np.zeros(_ROWS_PER_BLOCK, ROW)
        self._filled = 0
        self._block(b"H", json.dumps({"row": ROW.descr, "cutter": CUTTER}).encode())

    @property
    def row(self) -> Any:
        """The row to fill, valid until `commit`."""
        return self._rows[self._filled]

    def commit(self) -> None:
        """Complete the row."""
        self._filled += 1
        if self._filled == _ROWS_PER_BLOCK:
            self.flush()

    def event(self, event: dict[str, Any]) -> None:
        """Write an event after the rows before it."""
        self.flush()
        self._block(b"E", json.dumps(event).encode())

    def flush(self) -> None:
        """Write the buffered rows."""
        if self._filled:
            self._block(b"R", self._rows[: self._filled].tobytes())
            self._filled = 0

    def close(self) -> None:
        """Write the buffered rows and close; idempotent."""
        if not self._file.closed:
            self.flush()
            self._file.close()

    def _block(self, kind: bytes, data: bytes) -> None:
        self._file.write(_BLOCK_HEADER.pack(kind, len(data)) + data)


def read(path: Path) -> Trace:
    """Load a trace; it may be incomplete.

    Raises:
        InputError: Not a trace, or of another version.
    """
    data = path.read_bytes()
    blocks, events, at, header = [], [], 0, None
    while at + _BLOCK_HEADER.size <= len(data):
        kind, length = _BLOCK_HEADER.unpack_from(data, at)
        body = data[at + _BLOCK_HEADER.size : at + _BLOCK_HEADER.size + length]
        at += _BLOCK_HEADER.size + length
        if len(body) < length:
            break
        if kind == b"H":
            header = json.loads(body)
        elif kind == b"R":
            blocks.append(np.frombuffer(body, ROW))
        elif kind == b"E":
            events.append(json.loads(body))
        else:
            break
    if header is None or header["row"] != json.loads(json.dumps(ROW.descr)):
        raise InputError(f"{path} is not a trace of this version")
    return Trace(np.concatenate([np.zeros(0, ROW), *blocks]), tuple(events))
