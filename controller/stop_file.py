"""File of the latched stops. Latched stops survive a restart of the controller."""

from pathlib import Path
from typing import Any

from rolling_panda.messages.supervision import StopRecord
from rolling_panda.reasons import with_reason
from rolling_panda.runtime.latest_file import KeptValue, LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept

_NAME = "controller-stops.json"
#: The newest first.
Stops = tuple[StopRecord, ...]


def open_stop_file(folder: Path) -> KeptValue[Stops]:
    """The latched stops kept in a folder.

    Raises:
        InputError: They cannot be read: a controller that does not know what was stopped must not start.
    """
    path = folder / _NAME
    stops = read_kept(path, Stops, (), "which stops were latched", upgrade=_upgraded)
    return KeptValue(stops, LatestFileWriter(path))


def _upgraded(stops: Any) -> Any:
    return [with_reason(stop) for stop in stops] if isinstance(stops, list) else stops
