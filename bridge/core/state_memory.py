"""What the bridge must still know after a restart, so that an older token never moves the robot again."""

from pathlib import Path

import msgspec

from rolling_panda.messages.supervision import StopRecord
from rolling_panda.runtime.latest_file import LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept

_NAME = "bridge.json"


class Remembered(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is kept.

    Attributes:
        epoch: Newest one accepted.
        token: Random part of its token; None before the first.
        stops: Latched stops, the newest first.
        released: Ids of stops that were released: late repetitions of them latch nothing.
        released_by: Who released the last one, and why.
    """

    epoch: int = 0
    token: str | None = None
    stops: tuple[StopRecord, ...] = ()
    released: tuple[str, ...] = ()
    released_by: str = ""


class Memory:
    """Keeps the newest `Remembered`; with a keeper also beyond the process."""

    def __init__(self, remembered: Remembered | None = None, keeper: LatestFileWriter | None = None) -> None:
        """Begin with what was remembered."""
        self.remembered = remembered or Remembered()
        self._keeper = keeper

    @property
    def failure(self) -> str:
        """Why the newest is not on disk; empty when it is, or is on its way."""
        return "" if self._keeper is None else self._keeper.failure

    @property
    def kept(self) -> bool:
        """Whether the newest would be remembered after a kill at this moment."""
        return self._keeper is None or self._keeper.kept

    def keep(self, remembered: Remembered) -> None:
        """Remember; returns at once."""
        if remembered == self.remembered:
            return
        self.remembered = remembered
        if self._keeper is not None:
            self._keeper.keep(msgspec.json.encode(remembered))

    def close(self) -> None:
        """Have everything on disk."""
        if self._keeper is not None:
            self._keeper.close()


def open_memory(folder: Path) -> Memory:
    """The memory kept in a folder.

    Raises:
        InputError: It cannot be read: a bridge that does not know what was stopped must not start.
    """
    path = folder / _NAME
    remembered = read_kept(path, Remembered, Remembered(), "what the bridge remembers")
    return Memory(remembered, LatestFileWriter(path))
