"""The real bridge as a process, on fakes of the devices in another one, and a server whose page tells of it."""

import json
import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import httpx
import psutil

from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError
from rolling_panda.resources import resource
from rolling_panda.runtime.launch import child_environment, python_command
from rolling_panda.transport.zenoh import Router
from tests.support.processes.live_robot import free_port

_TOKEN = "for-this-measurement-only-0123456789abcdefghij"
_START_S = 180.0


class RealSite:
    """Router, fakes, bridge and server; use as a context manager. Nobody commands yet."""

    def __init__(self, address: str) -> None:
        """Start everything and wait until the page answers.

        Args:
            address: Loopback address of the arm's control box.

        Raises:
            InputError: Something did not come up.
        """
        self._folder = tempfile.TemporaryDirectory(prefix="rolling-panda-")
        self._processes: list[subprocess.Popen[str]] = []
        folder = Path(self._folder.name)
        port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self._router = Router(TransportConfig(mode="router", connect=(), listen=(self.endpoint,), plain_wire=True))
        config = folder / "fakes.toml"
        text = resource("assets/config/fakes.toml").read_text(encoding="utf-8")
        # Nobody looks at pictures here.
        text = re.sub(r"\[real.camera\]", "[real.camera]\nenabled = false", text)
        config.write_text(re.sub(r'address = "127[^"]*"', f'address = "{address}"', text), encoding="utf-8")
        token = folder / "token"
        token.touch(0o600)
        token.write_text(_TOKEN)
        shared = ["--config", str(config), "--connect", self.endpoint, "--plain-wire"]
        kept = ["--state", str(folder / "state")]
        self._log = (folder / "log").open("w+", encoding="utf-8")
        url = f"http://127.0.0.1:{port}"
        self._page = httpx.Client(base_url=url, headers={"Origin": url}, timeout=10.0)
        with ExitStack() as begun:
            begun.callback(self.close)
            self._devices = self._start("bridge.fakes", [*shared, "--arm", address])
            self._line()
            self.bridge = psutil.Process(self._start("bridge", ["real", "--fakes", *shared, *kept]).pid)
            self._start("server", [*shared, *kept, "--port", str(port), "--sign-in-token-file", str(token)])
            self.wait(self._answers, _START_S, "the page")
            # Once: the token is used up by the first.
            self._page.post("/api/sign-in", json={"token": _TOKEN}, timeout=60.0).raise_for_status()
            begun.pop_all()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def tell(self, line: str = "report") -> dict[str, dict[str, Any]]:
        """Let something happen to a device; what every device then says of itself."""
        assert self._devices.stdin is not None
        self._devices.stdin.write(line + "\n")
        self._devices.stdin.flush()
        answer: dict[str, dict[str, Any]] = json.loads(self._line())
        return answer

    def told_on_the_page(self) -> list[str]:
        """Lines of the page's log, oldest first."""
        return [str(row["text"]) for row in self._page.get("/api/events").json()["events"]]

    def arm_process(self) -> psutil.Process:
        """The process with libfranka's loop."""
        spawned = [child for child in self.bridge.children() if "spawn_main" in " ".join(child.cmdline())]
        return max(spawned, key=lambda child: child.cpu_times().user)

    def wait(self, condition: Callable[[], object], limit_s: float, what: str) -> None:
        """Poll until `condition()` holds.

        Raises:
            InputError: It did not, or a process has ended.
        """
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end or any(process.poll() is not None for process in self._processes):
                self._log.seek(0)
                raise InputError(f"waited in vain for {what}; the processes said:\n{self._log.read()[-2000:]}")
            time.sleep(0.02)

    def close(self) -> None:
        """End everything."""
        self._page.close()
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    pipe.close()
        self._router.close()
        self._log.close()
        self._folder.cleanup()

    def _start(self, module: str, words: list[str]) -> subprocess.Popen[str]:
        devices = module == "bridge.fakes"
        process = subprocess.Popen(
            python_command(module, words),
            stdin=subprocess.PIPE if devices else subprocess.DEVNULL,
            stdout=subprocess.PIPE if devices else self._log,
            stderr=self._log,
            text=True,
            env=child_environment(),
        )
        self._processes.append(process)
        return process

    def _line(self) -> str:
        assert self._devices.stdout is not None
        line = self._devices.stdout.readline()
        if not line:
            self._log.seek(0)
            raise InputError(f"the fakes have ended:\n{self._log.read()[-2000:]}")
        return line

    def _answers(self) -> bool:
        try:
            return self._page.get("/api/health").is_success
        except httpx.TransportError:
            return False
