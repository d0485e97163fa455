"""Writes the newest content of a small file in the background, and keeps the newest value of a type in one."""

import threading
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.state_folder import replace_durably

#: Time between attempts after a failed write (s).
_RETRY_S = 0.5

Value = TypeVar("Value")


class LatestFileWriter:
    """Writes the newest content of one file on its own thread; older content may be skipped.

    A failed write is retried until it succeeds.
    """

    def __init__(self, path: Path) -> None:
        """Write nothing yet."""
        self._path = path
        self._waiting: bytes | None = None
        self._changed = threading.Condition()
        self._ended = False
        #: Error of the last write; None after a success.
        self.failure: Reason | None = None
        self._thread = threading.Thread(target=self._write, name=f"keep {path.name}", daemon=True)
        self._thread.start()

    @property
    def kept(self) -> bool:
        """Whether the newest content is on disk."""
        return self._waiting is None

    def keep(self, content: bytes) -> None:
        """Put `content` in the file soon; returns at once."""
        with self._changed:
            self._waiting = content
            self._changed.notify()

    def close(self) -> None:
        """Try to write the pending content, and end; safe to call twice."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def _write(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting is not None or self._ended)
                content = self._waiting
            if content is None:
                return
            try:
                replace_durably(self._path, content)
            except OSError as error:
                self.failure = reasons.file_unwritable(str(self._path), error.strerror or "")
                with self._changed:
                    if self._ended:
                        return
                    self._changed.wait(_RETRY_S)
                continue
            with self._changed:
                self.failure = None
                if self._waiting is content:
                    self._waiting = None


class KeptValue(Generic[Value]):
    """The newest value; with a writer it outlives the process.

    Attributes:
        value: The newest, whether or not it is on disk.
    """

    def __init__(self, value: Value, writer: LatestFileWriter | None = None) -> None:
        """Start with the value of an earlier start."""
        self.value = value
        self._writer = writer

    @property
    def failure(self) -> Reason | None:
        """Why the newest value is not on disk; None when it is, or is being written."""
        return None if self._writer is None else self._writer.failure

    @property
    def kept(self) -> bool:
        """Whether a restart would find the newest value."""
        return self._writer is None or self._writer.kept

    def keep(self, value: Value) -> None:
        """Write the value as JSON in the background; returns at once."""
        if value == self.value:
            return
        self.value = value
        if self._writer is not None:
            self._writer.keep(msgspec.json.encode(value))

    def close(self) -> None:
        """Finish writing."""
        if self._writer is not None:
            self._writer.close()
