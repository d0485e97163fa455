"""A recording as it is read back: messages in the order in which they came, also of a file that was cut off."""

import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.writer import MCAP0_MAGIC

from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.topics import TOPICS, Topic

# Of each record: its kind, and how long it is.
_HEAD = struct.Struct("<BQ")
_TOPICS: dict[str, Topic[Any]] = {f"/{topic.name}": topic for topic in TOPICS}


@dataclass(frozen=True)
class Recorded:
    """One message: its topic, when it came (s since 1970), and itself as JSON until it is wanted."""

    topic: Topic[Any]
    at: float
    data: bytes

    def message(self) -> m.Message:
        """The message.

        Raises:
            InputError: It is not one that this version knows.
        """
        try:
            decoded: m.Message = msgspec.json.decode(self.data, type=self.topic.message)
        except msgspec.ValidationError as error:
            raise InputError(f"the recording holds a {self.topic.name} of another version: {error}") from error
        return decoded


@dataclass(frozen=True)
class Tape:
    """All messages in order, and whether the file ends as it should."""

    rows: tuple[Recorded, ...]
    whole: bool

    @property
    def begins_at(self) -> float:
        """Of the first message (s since 1970)."""
        return self.rows[0].at

    @property
    def duration_s(self) -> float:
        """From the first to the last message (s)."""
        return self.rows[-1].at - self.rows[0].at


def read_tape(path: Path) -> Tape:
    """Read a recording; what is after a torn end is left out.

    Raises:
        InputError: The file cannot be read, is no MCAP, or holds no message of this program.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    if not data.startswith(MCAP0_MAGIC):
        raise InputError(f"{path} is no recording: it does not begin as an MCAP file does")
    rows: list[Recorded] = []
    whole = True
    try:
        for _, channel, message in NonSeekingReader(io.BytesIO(_records(data))).iter_messages(log_time_order=False):
            topic = _TOPICS.get(channel.topic)
            if topic is not None:
                rows.append(Recorded(topic, 1e-9 * message.log_time, message.data))
    except McapError:
        # Without an end: whoever recorded was killed.
        whole = False
    if not rows:
        raise InputError(f"{path} holds no message of Rolling Panda")
    return Tape(tuple(sorted(rows, key=lambda row: row.at)), whole)


def _records(data: bytes) -> bytes:
    """All but a last record that was cut off: the reader does not look how much of one is there."""
    at = len(MCAP0_MAGIC)
    while at + _HEAD.size <= len(data):
        opcode, size = _HEAD.unpack_from(data, at)
        if at + _HEAD.size + size > len(data):
            return data[:at]
        at += _HEAD.size + int(size)
        if opcode == Opcode.FOOTER:
            return data
    return data[:at]
