"""A fake device in a process of its own, told what to do by lines and answering with JSON."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from rolling_panda.launch import child_environment

TESTS = Path(__file__).resolve().parent


class DeviceProcess:
    def __init__(self, script: str, *arguments: str) -> None:
        environment = {**child_environment(), "PYTHONPATH": f"{TESTS.parent}:{TESTS}"}
        self.process = subprocess.Popen(
            [sys.executable, str(TESTS / script), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self._line() == "ready"

    def tell(self, line: str = "report") -> dict[str, Any]:
        """Do something; what the device then says of itself."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._line())
        return answer

    def close(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        if self.process.poll() is None:
            self.process.stdin.close()
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.process.stdout.close()

    def _line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"the device has ended: exit code {self.process.wait(5)}"
        return line.strip()
