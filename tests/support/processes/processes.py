"""Processes of the program, each under a name and with a log of its own, that one can watch, halt or kill."""

import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rolling_panda.closing import Closing
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.launch import child_environment, python_command


class Processes(Closing):
    """Use as a context manager: leaving it ends everything.

    Attributes:
        folder: For the logs and what the processes keep.
        environment: Of each process.
        processes: Those that were launched and not killed, by name.
    """

    def __init__(self, folder: Path) -> None:
        """Start nothing yet."""
        self.folder, self.environment = folder, child_environment()
        self.processes: dict[str, subprocess.Popen[str]] = {}

    def launch(self, name: str, module: str, words: Sequence[str], answers: bool = False) -> "subprocess.Popen[str]":
        """Start (or start again) a process; what it says goes to its log, or with `answers` to `answer`."""
        self._close_pipes(name)
        with self.log(name).open("a") as log:
            self.processes[name] = subprocess.Popen(
                python_command(module, words),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE if answers else log,
                stderr=log,
                text=True,
                env=self.environment,
            )
        return self.processes[name]

    def answer(self, name: str, line: str = "") -> str:
        """The next line that a process says, after it was told `line`.

        Raises:
            RollingPandaError: It has ended.
        """
        process = self.processes[name]
        assert process.stdin is not None and process.stdout is not None
        if line:
            process.stdin.write(line + "\n")
            process.stdin.flush()
        said = process.stdout.readline()
        if not said:
            raise RollingPandaError(f"{name} ended\n{self.logs()}")
        return said.removesuffix("\n")

    def kill(self, name: str) -> float:
        """Kill -9, and wait until it is gone. Returns when (s, monotonic: the clock that all processes share)."""
        at = self._signal(name, signal.SIGKILL)
        self.processes[name].wait()
        self._close_pipes(name)
        del self.processes[name]
        return at

    def halt(self, name: str) -> float:
        """SIGSTOP: the process stands still with all its connections. Returns when (s, monotonic)."""
        return self._signal(name, signal.SIGSTOP)

    def go_on(self, name: str) -> float:
        """SIGCONT. Returns when (s, monotonic)."""
        return self._signal(name, signal.SIGCONT)

    def wait(self, condition: Callable[[], Any], limit_s: float, what: str) -> Any:
        """Poll until `condition()` is truthy; its value.

        Raises:
            RollingPandaError: It was not within `limit_s`, or a process has ended by itself.
        """
        end = time.monotonic() + limit_s
        while not (value := condition()):
            ended = self.ended()
            if ended or time.monotonic() > end:
                why = f"{', '.join(ended)} ended" if ended else f"waited {limit_s:.0f} s for {what}"
                raise RollingPandaError(f"{why}; {self.describe()}\n{self.logs()}")
            time.sleep(0.05)
        return value

    def ended(self) -> list[str]:
        """Names of those that have ended by themselves."""
        return [name for name, process in self.processes.items() if process.poll() is not None]

    def describe(self) -> str:
        """What the processes do, for reports."""
        return f"{', '.join(self.processes)} run"

    def log(self, name: str) -> Path:
        """What a process has said."""
        return self.folder / f"{name}.log"

    def logs(self) -> str:
        """The last lines of every process."""
        parts = []
        for log in sorted(self.folder.glob("*.log")):
            lines = log.read_text(errors="replace").splitlines()[-15:]
            parts.append("\n".join([f"--- {log.stem}", *lines]))
        return "\n".join(parts)

    def close(self) -> None:
        """End everything, politely first."""
        for process in reversed(self.processes.values()):
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
        for name, process in self.processes.items():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            self._close_pipes(name)

    def _signal(self, name: str, number: int) -> float:
        at = time.monotonic()
        self.processes[name].send_signal(number)
        return at

    def _close_pipes(self, name: str) -> None:
        process = self.processes.get(name)
        for pipe in () if process is None else (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()
