"""A recording on disk: every message as JSON with its schema, in chunks so small that a kill loses little."""

import json
from pathlib import Path
from typing import Any

import msgspec
from mcap.writer import Writer

from recorder.foxglove import VIEWS, View
from recorder.schemas import schema_of
from rolling_panda import __version__
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.topics import TOPICS, Topic

_ENCODER = msgspec.json.Encoder()
# However little comes in, `flush` ends a chunk; however much, it ends here (bytes).
_CHUNK = 256 * 1024


class Recording:
    """Writes an MCAP file. What was flushed can be read whatever happens to the recorder afterwards."""

    def __init__(self, path: Path, robot_id: str) -> None:
        """Begin the file.

        Args:
            path: Of the file; one that exists is not overwritten.
            robot_id: Whose wire it is.

        Raises:
            InputError: It exists already or cannot be written.
        """
        try:
            self._file = path.open("xb")
        except FileExistsError as error:
            raise InputError(f"{path} exists already; give another name with --out") from error
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from error
        self._writer = Writer(self._file, chunk_size=_CHUNK)
        self._writer.start(profile="", library=f"rolling-panda {__version__}")
        self._channels = {topic.name: self._channel(topic, robot_id) for topic in TOPICS}
        self._views = {kind: self._view(view) for kind, view in VIEWS.items()}
        self._numbers = dict.fromkeys((*self._channels.values(), *self._views.values()), 0)
        self.messages = 0

    def add(self, topic: Topic[Any], message: m.Message, at_ns: int) -> None:
        """Record a message received at `at_ns` (since 1970)."""
        self._add(self._channels[topic.name], _ENCODER.encode(message), at_ns)
        view = VIEWS.get(type(message))
        shown = None if view is None else view.make(message, at_ns)
        if shown is not None:
            self._add(self._views[type(message)], _ENCODER.encode(shown), at_ns)

    def flush(self) -> None:
        """Hand everything over to the operating system."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and close; safe to call twice."""
        if not self._file.closed:
            self._writer.finish()
            self._writer.flush()
            self._file.close()

    def _add(self, channel: int, data: bytes, at_ns: int) -> None:
        self._numbers[channel] += 1
        self.messages += 1
        self._writer.add_message(channel, at_ns, data, at_ns, self._numbers[channel])

    def _channel(self, topic: Topic[Any], robot_id: str) -> int:
        schema = json.dumps(schema_of(topic.message)).encode()
        number = self._writer.register_schema(f"rolling_panda.{topic.message.__name__}", "jsonschema", schema)
        about = {"robot_id": robot_id, "about": topic.about}
        channel: int = self._writer.register_channel(f"/{topic.name}", "json", number, about)
        return channel

    def _view(self, view: View) -> int:
        number = self._writer.register_schema(view.name, "jsonschema", json.dumps(view.schema).encode())
        channel: int = self._writer.register_channel(f"/foxglove/{view.channel}", "json", number)
        return channel
