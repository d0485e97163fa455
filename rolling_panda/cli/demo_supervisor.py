"""Child processes of the demo: started with a log each, watched, and ended to the last one."""

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rolling_panda.runtime.launch import child_environment

#: A process that has not ended this long after being asked is killed (s).
ASK_S = 3.0
_TAIL_LINES = 12


@dataclass(frozen=True)
class Death:
    """A child that ended by itself.

    Attributes:
        name: Which.
        how: In words: exit code or signal.
        tail: Last lines that it wrote.
    """

    name: str
    how: str
    tail: str


class Supervisor:
    """Starts named children and leaves none behind."""

    def __init__(self, log_folder: Path) -> None:
        """Write what each child prints to `log_folder/<name>.log`."""
        self._log_folder = log_folder
        self._children: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, command: Sequence[str]) -> None:
        """Start one child.

        It gets a pipe as standard input, which closes when this process ends in whatever way, and a session of its
        own, so that Ctrl-C in the terminal reaches this process alone and the children end in order.
        """
        with self.log(name).open("wb") as log:
            self._children[name] = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                # Unbuffered: the last words of a killed process must be in its log.
                env=child_environment() | {"PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )

    def log(self, name: str) -> Path:
        """Where a child's output goes."""
        return self._log_folder / f"{name}.log"

    def pids(self) -> dict[str, int]:
        """Process id of every child started."""
        return {name: child.pid for name, child in self._children.items()}

    def death(self) -> Death | None:
        """The first child found to have ended, or None while all run."""
        for name, child in self._children.items():
            code = child.poll()
            if code is not None:
                return Death(name, _how(code), _tail(self.log(name)))
        return None

    def end(self) -> None:
        """End every child, and whatever each has started: ask, wait up to `ASK_S`, kill."""
        for child in self._children.values():
            _signal(child, signal.SIGTERM)
        deadline = time.monotonic() + ASK_S
        for child in self._children.values():
            try:
                child.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                _signal(child, signal.SIGKILL)
        for child in self._children.values():
            child.wait()
            _signal(child, signal.SIGKILL)
            if child.stdin is not None:
                child.stdin.close()
        self._children.clear()


def _signal(child: subprocess.Popen[bytes], number: int) -> None:
    """Signal a child's whole group; the group outlives a leader that has left children of its own."""
    try:
        os.killpg(child.pid, number)
    except (ProcessLookupError, PermissionError):
        return


def _how(code: int) -> str:
    if code >= 0:
        return f"with exit code {code}"
    try:
        return f"by signal {-code} ({signal.Signals(-code).name})"
    except ValueError:
        return f"by signal {-code}"


def _tail(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").rstrip().splitlines()
    return "\n".join(lines[-_TAIL_LINES:])
