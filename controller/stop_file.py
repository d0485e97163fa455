"""File of the latched stops. Latched stops survive a restart of the controller."""

from pathlib import Path

import msgspec

from rolling_panda.messages.supervision import StopRecord, StopState
from rolling_panda.runtime.latest_file import LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept

_NAME = "controller-stops.json"


class StopFile:
    """Writes the newest latched stops; without a writer nothing outlives the process."""

    def __init__(self, stops: tuple[StopRecord, ...] = (), writer: LatestFileWriter | None = None) -> None:
        """Start with the stops of an earlier start, the newest first."""
        self.stops = stops
        self._writer = writer

    @property
    def kept(self) -> bool:
        """Whether the newest stops are on disk."""
        return self._writer is None or self._writer.kept

    @property
    def failure(self) -> str:
        """Why the newest stops are not on disk; empty when they are, or are being written."""
        return "" if self._writer is None else self._writer.failure

    def write(self, state: StopState) -> None:
        """Write the latched stops in the background."""
        if state.stops == self.stops:
            return
        self.stops = state.stops
        if self._writer is not None:
            self._writer.keep(msgspec.json.encode(state.stops))

    def close(self) -> None:
        """Finish writing and close."""
        if self._writer is not None:
            self._writer.close()


def open_stop_file(folder: Path) -> StopFile:
    """The latch kept in a folder.

    Raises:
        InputError: It cannot be read: a controller that does not know what was stopped must not start.
    """
    path = folder / _NAME
    stops = read_kept(path, tuple[StopRecord, ...], (), "which stops were latched")
    return StopFile(stops, LatestFileWriter(path))
