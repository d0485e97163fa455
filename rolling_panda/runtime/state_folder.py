"""Where a process keeps what must survive a restart, and how a small file there is replaced whole or not at all."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import msgspec

from rolling_panda.errors import InputError

Kept = TypeVar("Kept")


def usual_state_folder(robot_id: str) -> Path:
    """`rolling-panda/ROBOT` in the user's folder for programs' state (XDG base directories)."""
    told = os.environ.get("XDG_STATE_HOME", "")
    # The specification has a relative path ignored.
    root = Path(told) if Path(told).is_absolute() else Path.home() / ".local" / "state"
    return root / "rolling-panda" / robot_id


def open_state_folder(folder: Path) -> Path:
    """The folder, made for this user alone where it is missing.

    Raises:
        InputError: It cannot be made, or is something else.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot keep state in {folder}: {error.strerror}; give another folder with --state"
        ) from error
    return folder


@contextmanager
def alone(folder: Path, process: str) -> Iterator[None]:
    """Be the only process of its kind that works with a folder; however it ends, the next one may.

    Raises:
        InputError: Another one is at work.
    """
    path = folder / f"{process}.lock"
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise InputError(
            f"cannot keep state in {folder}: {error.strerror}; give another folder with --state"
        ) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(
                f"another {process} works with {folder}: two would cut the same point; end it, or give another --state"
            ) from error
        yield
    finally:
        os.close(descriptor)


def read_kept(
    path: Path,
    kind: type[Kept],
    nothing: Kept,
    what: str,
    remedy: str = "look whether the robot may move, then remove it",
) -> Kept:
    """What `replace_durably` last wrote as JSON; `nothing` where it has never written.

    Args:
        path: Of the file.
        kind: What it must decode to.
        nothing: What there is before the first time.
        what: What it says, in words, for the error.
        remedy: What to do when it cannot be read.

    Raises:
        InputError: It cannot be read: a program that does not know what was stopped must not start.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind) if path.exists() else nothing
    except (OSError, msgspec.MsgspecError) as error:
        raise InputError(f"cannot read {what} in {path}: {error}; {remedy}") from error


def replace_durably(path: Path, content: bytes) -> None:
    """Replace a file by `content`; after any interruption there is the old one or the new one, whole.

    Raises:
        OSError: The content is not on disk.
    """
    beside = path.with_name(f".{path.name}.new")
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError:
        beside.unlink(missing_ok=True)
        raise
    # The new name is durable only once the folder is.
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable.

    Raises:
        OSError: They are not.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
