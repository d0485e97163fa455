"""The folder of the state that survives a restart, and the atomic replacement of files in it."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from rolling_panda.errors import InputError

Kept = TypeVar("Kept")


def usual_state_folder(robot_id: str) -> Path:
    """`rolling-panda/ROBOT` in the user's folder for programs' state (XDG base directories)."""
    configured = os.environ.get("XDG_STATE_HOME", "")
    # The specification demands that a relative path is ignored.
    root = Path(configured) if Path(configured).is_absolute() else Path.home() / ".local" / "state"
    return root / "rolling-panda" / robot_id


def open_state_folder(folder: Path) -> Path:
    """The folder, created for this user alone where it is missing.

    Raises:
        InputError: It cannot be created, or is no folder.
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
    """Hold an exclusive lock of a folder for one kind of process; the kernel releases it when the process ends.

    Raises:
        InputError: Another process holds it.
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
    upgrade: Callable[[Any], Any] | None = None,
) -> Kept:
    """Read a JSON file that `replace_durably` wrote; `nothing` where it does not exist.

    Args:
        path: Of the file.
        kind: Type of the content.
        nothing: Content before the first write.
        what: Description of the content, for the error.
        remedy: What to do on an error.
        upgrade: Turns decoded content of an earlier version into that of this one.

    Raises:
        InputError: It cannot be read: a process that does not know its latched stops must not start.
    """
    try:
        if not path.exists():
            return nothing
        content = msgspec.json.decode(path.read_bytes())
        return msgspec.convert(content if upgrade is None else upgrade(content), kind)
    except (OSError, msgspec.MsgspecError) as error:
        raise InputError(f"cannot read {what} in {path}: {error}; {remedy}") from error


def replace_durably(path: Path, content: bytes) -> None:
    """Replace a file atomically and durably; an interruption leaves the old content or the new.

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
    # The new name is durable only after the folder is synced.
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Sync a folder, which makes the names in it durable.

    Raises:
        OSError: The sync failed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
