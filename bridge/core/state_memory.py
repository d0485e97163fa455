"""State that the bridge keeps across restarts, so that an older token never moves the robot again."""

import secrets
import time
from pathlib import Path
from typing import Any

import msgspec

from rolling_panda import reasons
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.messages.types import Epoch, Reason
from rolling_panda.reasons import with_reason
from rolling_panda.runtime.latest_file import KeptValue, LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept, replace_durably

_NAME = "bridge.json"


class Remembered(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The stored state.

    Attributes:
        epoch: Epoch of the newest fencing token.
        token: Random part of the token; None without a holder.
        stops: Latched stops, newest first.
        released: Ids of released stops; late repetitions of them do not latch.
        released_by: Who made the last release and why; None before the first.
    """

    epoch: Epoch = 0
    token: str | None = None
    stops: tuple[StopRecord, ...] = ()
    released: tuple[str, ...] = ()
    released_by: Reason | None = None


def open_memory(folder: Path) -> KeptValue[Remembered]:
    """The memory kept in a folder.

    Raises:
        InputError: It cannot be read: a bridge that does not know what was stopped must not start.
    """
    path = folder / _NAME
    remedy = f"check that the robot may move, then run: rolling-panda bridge --begin-anew --state {folder}"
    remembered = read_kept(path, Remembered, Remembered(), "what the bridge remembers", remedy, _upgraded)
    return KeptValue(remembered, LatestFileWriter(path))


def _upgraded(content: Any) -> Any:
    if isinstance(content, dict):
        if isinstance(stops := content.get("stops"), list):
            content = content | {"stops": [with_reason(stop) for stop in stops]}
        if content.get("released_by") == "":
            content = content | {"released_by": None}
    return with_reason(content, "released_by")


def begin_anew(folder: Path) -> Reason:
    """Set the stored state aside, whatever it is, and latch a stop in its place. Returns what was done.

    The stops of before are unknown: a supervisor has to inspect the robot and reset before anything moves.

    Raises:
        OSError: The folder cannot be written.
    """
    path, done = folder / _NAME, reasons.bridge_state_absent()
    if path.exists():
        aside = path.replace(path.with_suffix(".aside"))
        done = reasons.bridge_state_set_aside(str(aside))
    stop = StopRecord(f"anew-{secrets.token_hex(8)}", "bridge", "", done, time.time())
    replace_durably(path, msgspec.json.encode(Remembered(stops=(stop,))))
    return done
