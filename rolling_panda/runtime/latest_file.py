"""Writes the newest content of a small file in the background."""

import threading
from pathlib import Path

from rolling_panda.runtime.state_folder import replace_durably

#: Time between attempts after a failed write (s).
_RETRY_S = 0.5


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
        #: Error of the last write; empty after a success.
        self.failure = ""
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
                self.failure = f"{self._path} cannot be written: {error.strerror}"
                with self._changed:
                    if self._ended:
                        return
                    self._changed.wait(_RETRY_S)
                continue
            with self._changed:
                self.failure = ""
                if self._waiting is content:
                    self._waiting = None
