"""Recordings as MCAP files: every message as JSON with its schema, written in small chunks and read back in order."""

import io
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.writer import MCAP0_MAGIC, Writer

from recorder.foxglove import CHANNELS, FoxgloveChannel
from rolling_panda import __version__
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.topics import TOPICS, Topic

T = TypeVar("T")
_ENCODER = msgspec.json.Encoder()
#: Largest size of a chunk (bytes); `flush` ends one earlier.
_CHUNK_SIZE = 256 * 1024
#: Header of an MCAP record: opcode and length.
_RECORD_HEADER = struct.Struct("<BQ")
_TOPICS: dict[str, Topic[Any]] = {f"/{topic.name}": topic for topic in TOPICS}
#: Schema version of the wire, in the metadata of a channel; recordings of version 1 have none.
_VERSION_KEY = "schema_version"
_JSON_TYPES = ("boolean", "integer", "number", "string")


class RecordingWriter:
    """Writes an MCAP file. Flushed messages are readable even if the recorder is killed."""

    def __init__(self, path: Path, robot_id: str) -> None:
        """Create the file.

        Args:
            path: New file; an existing one is not overwritten.
            robot_id: Id of the robot, stored with each channel.

        Raises:
            InputError: The file exists or cannot be written.
        """
        try:
            self._file = path.open("xb")
        except FileExistsError as error:
            raise InputError(f"{path} exists already; give another name with --out") from error
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from error
        self._writer = Writer(self._file, chunk_size=_CHUNK_SIZE)
        self._writer.start(profile="", library=f"rolling-panda {__version__}")
        self._channels = {topic.name: self._topic_channel(topic, robot_id) for topic in TOPICS}
        self._foxglove = {kind: self._foxglove_channel(channel) for kind, channel in CHANNELS.items()}
        self._sequences = dict.fromkeys((*self._channels.values(), *self._foxglove.values()), 0)
        self.message_count = 0

    def write(self, topic: Topic[Any], message: m.Message, stamp_ns: int) -> None:
        """Write a message received at `stamp_ns` (Unix time), and its Foxglove message if there is one."""
        self._write(self._channels[topic.name], message, stamp_ns)
        channel = CHANNELS.get(type(message))
        converted = None if channel is None else channel.convert(message, stamp_ns)
        if converted is not None:
            self._write(self._foxglove[type(message)], converted, stamp_ns)

    def flush(self) -> None:
        """End the chunk and pass it to the operating system."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and close the file; idempotent."""
        if not self._file.closed:
            self._writer.finish()
            self._writer.flush()
            self._file.close()

    def _write(self, channel: int, message: Any, stamp_ns: int) -> None:
        self._sequences[channel] += 1
        self.message_count += 1
        self._writer.add_message(channel, stamp_ns, _ENCODER.encode(message), stamp_ns, self._sequences[channel])

    def _topic_channel(self, topic: Topic[Any], robot_id: str) -> int:
        schema = json.dumps(schema_of(topic.message)).encode()
        schema_id = self._writer.register_schema(f"rolling_panda.{topic.message.__name__}", "jsonschema", schema)
        metadata = {"robot_id": robot_id, "about": topic.about, _VERSION_KEY: str(m.SCHEMA_VERSION)}
        channel_id: int = self._writer.register_channel(f"/{topic.name}", "json", schema_id, metadata)
        return channel_id

    def _foxglove_channel(self, channel: FoxgloveChannel) -> int:
        schema = json.dumps(channel.schema).encode()
        schema_id = self._writer.register_schema(channel.schema_name, "jsonschema", schema)
        channel_id: int = self._writer.register_channel(f"/foxglove/{channel.name}", "json", schema_id)
        return channel_id


@dataclass(frozen=True)
class RecordedMessage:
    """A message: its topic, Unix time of reception (s), and JSON, decoded on demand."""

    topic: Topic[Any]
    at: float
    data: bytes

    def message(self) -> m.Message:
        """Decode the message.

        Raises:
            InputError: It does not fit this version's type.
        """
        message: m.Message = self.decoded(self.topic.message)
        return message

    def decoded(self, kind: type[T]) -> T:
        """Decode the message as a type that may have some of its fields only.

        Raises:
            InputError: It does not fit that type.
        """
        try:
            return msgspec.json.decode(self.data, type=kind)
        except msgspec.ValidationError as error:
            raise InputError(f"the recording holds a {self.topic.name} of another version: {error}") from error


@dataclass(frozen=True)
class Recording:
    """All messages in order of time, and whether the file is complete."""

    messages: tuple[RecordedMessage, ...]
    complete: bool

    @property
    def begins_at(self) -> float:
        """Unix time of the first message (s)."""
        return self.messages[0].at

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message (s)."""
        return self.messages[-1].at - self.messages[0].at


def read_recording(path: Path) -> Recording:
    """Read a recording; an incomplete last record is ignored.

    Raises:
        InputError: The file cannot be read, is not an MCAP file, is of another schema version of the wire, or has no
            message of Rolling Panda.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    if not data.startswith(MCAP0_MAGIC):
        raise InputError(f"{path} is no recording: it does not begin as an MCAP file does")
    messages: list[RecordedMessage] = []
    complete = True
    try:
        for _, channel, message in NonSeekingReader(io.BytesIO(_complete_records(data))).iter_messages(
            log_time_order=False
        ):
            topic = _TOPICS.get(channel.topic)
            if topic is not None:
                _check_version(path, channel.metadata.get(_VERSION_KEY, "1"))
                messages.append(RecordedMessage(topic, 1e-9 * message.log_time, message.data))
    except McapError:
        # No footer: the recorder was killed.
        complete = False
    if not messages:
        raise InputError(f"{path} holds no message of Rolling Panda")
    return Recording(tuple(sorted(messages, key=lambda each: each.at)), complete)


def _check_version(path: Path, version: str) -> None:
    if version != str(m.SCHEMA_VERSION):
        raise InputError(
            f"{path} has schema version {version} of the wire, and this version of Rolling Panda replays version "
            f"{m.SCHEMA_VERSION} only. Replay it with the version that recorded it, or open it in Foxglove"
        )


def _complete_records(data: bytes) -> bytes:
    """The data without an incomplete last record, which the reader does not check for."""
    at = len(MCAP0_MAGIC)
    while at + _RECORD_HEADER.size <= len(data):
        opcode, size = _RECORD_HEADER.unpack_from(data, at)
        if at + _RECORD_HEADER.size + size > len(data):
            return data[:at]
        at += _RECORD_HEADER.size + int(size)
        if opcode == Opcode.FOOTER:
            return data
    return data[:at]


def schema_of(kind: type[m.Message]) -> dict[str, Any]:
    """JSON schema of a message for Foxglove, which knows no bounds, patterns, references or optional values."""
    (reference,), definitions = msgspec.json.schema_components((kind,), ref_template="{name}")
    return {"title": kind.__name__, **_simple(reference, definitions)}


def _simple(schema: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in schema:
        return _simple(definitions[schema["$ref"]], definitions)
    if "anyOf" in schema:
        return _simple(next(each for each in schema["anyOf"] if each.get("type") != "null"), definitions)
    if schema.get("type") == "object":
        fields = schema.get("properties", {})
        return {"type": "object", "properties": {name: _simple(field, definitions) for name, field in fields.items()}}
    if schema.get("type") == "array":
        items = schema.get("items") or schema.get("prefixItems", [{"type": "number"}])[0]
        return {"type": "array", "items": _simple(items, definitions)}
    if schema.get("contentEncoding") == "base64":
        return {"type": "string", "contentEncoding": "base64"}
    return {"type": schema["type"] if schema.get("type") in _JSON_TYPES else "string"}
