"""The controller's latched stops on disk, so that a start of the controller releases nothing."""

from pathlib import Path

import msgspec

from rolling_panda.control_messages import StopRecord, StopState
from rolling_panda.keeper import Keeper
from rolling_panda.state_folder import read_kept

_NAME = "controller-stops.json"


class StopFile:
    """Keeps the newest latch; without a keeper it keeps nothing beyond the process."""

    def __init__(self, stops: tuple[StopRecord, ...] = (), keeper: Keeper | None = None) -> None:
        """Begin with what was latched before, the newest first."""
        self.stops = stops
        self._keeper = keeper

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
    return StopFile(stops, Keeper(path))
