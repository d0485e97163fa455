"""A fake device in a process of its own, told what to do by lines and answering with JSON."""

import json
import subprocess
from typing import Any

from rolling_panda.runtime.launch import child_environment, python_command


class DeviceProcess:
    def __init__(self, device: str, *options: str, wait: bool = True) -> None:
        """Of `bridge.fakes`: `arm` at `--arm ADDRESS`, or `base` (beside it the cutter) behind `--connect ENDPOINT`.

        Without `wait` it only begins to start; `wait_until_ready` has to follow.
        """
        self.device = device
        self.process = subprocess.Popen(
            python_command("bridge.fakes", options),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=child_environment(),
        )
        if wait:
            self.wait_until_ready()

    def wait_until_ready(self) -> None:
        assert self._line() == "ready"

    def tell(self, line: str = "report") -> dict[str, Any]:
        """Do something; what the device then says of itself."""
        return self.tell_all(f"{self.device} {line}")[self.device]

    def tell_all(self, line: str) -> dict[str, dict[str, Any]]:
        """The same with the device's name in the line; what every device says."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer: dict[str, dict[str, Any]] = json.loads(self._line())
        return answer

    def close(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        if self.process.poll() is None:
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
