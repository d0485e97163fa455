"""File of the latched stops. Latched stops survive a restart of the controller."""

from pathlib import Path

import msgspec

from rolling_panda.messages.supervision import StopRecord, StopState
from rolling_panda.runtime.latest_file import LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept

_NAME = "controller-stops.json"


class StopFile:
    """Keeps the newest latch; without a keeper it keeps nothing beyond the process."""

    def __init__(self, stops: tuple[StopRecord, ...] = (), keeper: LatestFileWriter | None = None) -> None:
        """Begin with what was latched before, the newest first."""
        self.stops = stops
        self._keeper = keeper

    @property
    def kept(self) -> bool:
        """Whether the newest would be latched after a kill at this moment."""
        return self._keeper is None or self._keeper.kept

    @property
    def failure(self) -> str:
        """Why the newest is not on disk; empty when it is, or is on its way."""
        return "" if self._keeper is None else self._keeper.failure

    def keep(self, state: StopState) -> None:
        """Keep what is latched now; returns at once."""
        if state.stops == self.stops:
            return
        self.stops = state.stops
        if self._keeper is not None:
            self._keeper.keep(msgspec.json.encode(state.stops))

    def close(self) -> None:
        """Have everything on disk."""
        if self._keeper is not None:
            self._keeper.close()


def open_stop_file(folder: Path) -> StopFile:
    """The latch kept in a folder.

    Raises:
        InputError: It cannot be read: a controller that does not know what was stopped must not start.
    """
    path = folder / _NAME
    stops = read_kept(path, tuple[StopRecord, ...], (), "which stops were latched")
    return StopFile(stops, LatestFileWriter(path))
