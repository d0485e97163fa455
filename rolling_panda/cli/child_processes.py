"""Child processes: started with a log file each, watched, and all ended."""

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rolling_panda.runtime.launch import child_environment

#: A process that has not ended this long after SIGTERM is killed (s).
GRACE_S = 3.0
_LAST_LINES = 12


@dataclass(frozen=True)
class ChildExit:
    """A child that has ended by itself.

    Attributes:
        name: Of the child.
        cause: Exit code or signal, as text.
        output: The last lines of its log.
    """

    name: str
    cause: str
    output: str


class ChildProcesses:
    """Starts named children and leaves none behind."""

    def __init__(self, log_folder: Path) -> None:
        """Write what each child prints to `log_folder/<name>.log`."""
        self._log_folder = log_folder
        self._children: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, command: Sequence[str]) -> None:
        """Start one child.

        Its standard input is a pipe, which closes when this process ends, even if it is killed. It has its own process
        session, so that Ctrl-C reaches this process alone, which ends the children in order.
        """
        with self.log(name).open("wb") as log:
            self._children[name] = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                # Unbuffered, so that the last lines of a killed process are in its log.
                env=child_environment() | {"PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )

    def log(self, name: str) -> Path:
        """The log file of a child."""
        return self._log_folder / f"{name}.log"

    def pids(self) -> dict[str, int]:
        """Process id of every child started."""
        return {name: child.pid for name, child in self._children.items()}

    def exited(self) -> ChildExit | None:
        """A child that has ended; None while all run."""
        for name, child in self._children.items():
            code = child.poll()
            if code is not None:
                return ChildExit(name, _cause(code), _last_lines(self.log(name)))
        return None

    def end(self) -> None:
        """End all children and their own children: SIGTERM, then SIGKILL after `GRACE_S`."""
        for child in self._children.values():
            _signal(child, signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
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
    """Signal a child's process group, which may outlive its leader."""
    try:
        os.killpg(child.pid, number)
    except (ProcessLookupError, PermissionError):
        return


def _cause(code: int) -> str:
    if code >= 0:
        return f"with exit code {code}"
    try:
        return f"by signal {-code} ({signal.Signals(-code).name})"
    except ValueError:
        return f"by signal {-code}"


def _last_lines(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").rstrip().splitlines()
    return "\n".join(lines[-_LAST_LINES:])
