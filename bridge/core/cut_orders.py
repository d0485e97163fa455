"""Cut orders: each `cut_id` is executed once, also across restarts, and only while the bridge follows commands."""

import os
import threading
from collections import deque
from pathlib import Path
from typing import Literal, Protocol

from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import CutCommand
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.runtime.state_folder import sync_folder

FILE = "cuts"
#: Time limit for the last entry at the end (s).
_END_S = 2.0

Kept = Literal["kept", "waiting", "failed"]


class CutMemory(Protocol):
    """Memory of cut ids."""

    @property
    def known(self) -> frozenset[str]:
        """Cut ids stored before this start."""

    def keep(self, cut_id: str) -> Kept:
        """Ask for a cut to be remembered, as often as wished; `kept` once it can no longer be forgotten."""


class ForLife:
    """Memory for the life of the process, which is the life of a simulated row."""

    @property
    def known(self) -> frozenset[str]:
        """Nothing was before."""
        return frozenset()

    def keep(self, cut_id: str) -> Kept:
        """Kept at once; the caller remembers it too."""
        return "kept"


class CutFile:
    """Memory in a file with one id a line. A separate thread flushes each to disk. Close it at the end.

    A hanging disk delays the cut, never the loop.
    """

    def __init__(self, folder: Path) -> None:
        """Read the stored cuts of a folder.

        Raises:
            InputError: The file cannot be read or written.
        """
        self._path = folder / FILE
        try:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
            with os.fdopen(descriptor, "rb") as file:
                lines = file.read().decode("utf-8", "replace").splitlines()
            sync_folder(folder)
        except OSError as error:
            raise InputError(
                f"cannot remember cuts in {self._path}: {error.strerror}; give another folder with --state"
            ) from error
        self._known = frozenset(lines)
        self._told: dict[str, Kept] = {}
        self._waiting: deque[str] = deque()
        self._some = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="cut-memory", daemon=True)
        self._thread.start()

    @property
    def known(self) -> frozenset[str]:
        """Cut ids stored before this start."""
        return self._known

    def keep(self, cut_id: str) -> Kept:
        """Store a cut; `failed` stays set if the disk fails."""
        with self._some:
            if cut_id not in self._told:
                self._told[cut_id] = "waiting"
                self._waiting.append(cut_id)
                self._some.notify()
            return self._told[cut_id]

    def close(self) -> None:
        """Write the pending entries and end."""
        with self._some:
            self._closing = True
            self._some.notify()
        self._thread.join(_END_S)

    def _run(self) -> None:
        # Scheduling is per thread: the disk has a lower priority than the control loop.
        set_priority("interface")
        while True:
            with self._some:
                while not self._waiting and not self._closing:
                    self._some.wait()
                if not self._waiting:
                    return
                cut_id = self._waiting.popleft()
            told: Kept = "kept" if self._write(cut_id) else "failed"
            with self._some:
                self._told[cut_id] = told

    def _write(self, cut_id: str) -> bool:
        try:
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND)
            try:
                # A line that was truncated by a full disk or a killed process stays a separate line.
                line = f"\n{cut_id}\n".encode()
                if os.write(descriptor, line) != len(line):
                    return False
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
        except OSError:
            return False
        return True


BUSY, FORGETFUL = reasons.blades_busy(), reasons.cut_not_remembered()

Verdict = Literal["cut", "known", "wait", "refuse"]


class CutOrders:
    """Remembers every ordered cut; with a durable memory, also across restarts."""

    def __init__(self, memory: CutMemory | None = None) -> None:
        """Start with the stored cuts."""
        self._memory = memory or ForLife()
        self._known: set[str] = set(self._memory.known)

    def judge(
        self, command: CutCommand, wrong: Reason | None, blades_free: bool, inhibited: Reason | None
    ) -> tuple[Verdict, Reason | None]:
        """Decide whether to close the blades now; returns the reason of a refusal.

        An order that arrives while the cutter is inhibited is used up: its repetitions must not cut later, when nobody
        expects it. An order that is not yet on disk waits for its next repetition. An order with a wrong token or too
        old, during another cut or in motion, changes nothing.

        Args:
            command: The order.
            wrong: Reason why the order is invalid; None if it is valid.
            blades_free: Whether the blades are open and idle.
            inhibited: Reason why the cutter is inhibited; None if it is not.
        """
        if command.cut_id in self._known:
            return "known", None
        if wrong is not None:
            return "refuse", wrong
        if not blades_free:
            return "refuse", BUSY
        kept = self._memory.keep(command.cut_id)
        if inhibited is not None:
            self._known.add(command.cut_id)
            return "refuse", inhibited
        if kept == "waiting":
            return "wait", None
        self._known.add(command.cut_id)
        return ("cut", None) if kept == "kept" else ("refuse", FORGETFUL)
