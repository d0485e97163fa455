"""How often a controller of this robot has started: counted durably, so that no token is ever given out twice."""

from pathlib import Path

from rolling_panda.errors import InputError
from rolling_panda.state_folder import replace_durably

_NAME = "controller-starts"


def count_start(folder: Path) -> int:
    """Count one more start; it is on disk when this returns.

    Raises:
        InputError: The count cannot be read or written.
    """
    path = folder / _NAME
    try:
        text = path.read_text(encoding="ascii") if path.exists() else "0"
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the count of starts in {path}: {error}") from error
    if not text.strip().isdecimal():
        raise InputError(
            f"{path} holds {text[:40]!r}, no count of starts; with every other process ended, remove it to begin anew"
        )
    starts = int(text) + 1
    try:
        replace_durably(path, f"{starts}\n".encode())
    except OSError as error:
        raise InputError(f"cannot count this start in {path}: {error.strerror}") from error
    return starts
