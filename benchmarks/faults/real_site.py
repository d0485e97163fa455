"""The real bridge as a process, on fakes of the devices in another one, and a server whose page tells of it."""

import json
import re
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import msgspec
import psutil

from rolling_panda.messages.types import Reason
from rolling_panda.resources import resource
from tests.support.processes.local_router import free_port, local_router
from tests.support.processes.processes import Processes

_TOKEN = "for-this-measurement-only-0123456789abcdefghij"
_START_S = 180.0


class RealSite(Processes):
    """Router, fakes, bridge and server; use as a context manager. Nobody commands yet."""

    def __init__(self, address: str) -> None:
        """Start everything and wait until the page answers.

        Args:
            address: Loopback address of the arm's control box.

        Raises:
            RollingPandaError: Something did not come up.
        """
        self._begun = ExitStack()
        folder = Path(self._begun.enter_context(tempfile.TemporaryDirectory(prefix="rolling-panda-")))
        super().__init__(folder)
        self.endpoint, port = self._begun.enter_context(local_router()), free_port()
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
        url = f"http://127.0.0.1:{port}"
        self._page = httpx.Client(base_url=url, headers={"Origin": url}, timeout=10.0)
        with ExitStack() as begun:
            begun.callback(self.close)
            self.launch("fakes", "bridge.fakes", [*shared, "--arm", address], answers=True)
            self.answer("fakes")
            self.bridge = psutil.Process(self.launch("bridge", "bridge", ["real", "--fakes", *shared, *kept]).pid)
            site = ["--port", str(port), "--sign-in-token-file", str(token)]
            self.launch("server", "server", [*shared, *kept, *site])
            self.wait(self._answers, _START_S, "the page")
            # Once: the token is used up by the first.
            self._page.post("/api/sign-in", json={"token": _TOKEN}, timeout=60.0).raise_for_status()
            begun.pop_all()

    def tell(self, line: str = "report") -> dict[str, dict[str, Any]]:
        """Let something happen to a device; what every device then says of itself."""
        answer: dict[str, dict[str, Any]] = json.loads(self.answer("fakes", line))
        return answer

    def told_on_the_page(self) -> list[Reason]:
        """Lines of the page's log, oldest first."""
        rows = self._page.get("/api/events").json()["events"]
        return [msgspec.convert(row["reason"], Reason) for row in rows if row["reason"] is not None]

    def arm_process(self) -> psutil.Process:
        """The process with libfranka's loop."""
        spawned = [child for child in self.bridge.children() if "spawn_main" in " ".join(child.cmdline())]
        return max(spawned, key=lambda child: child.cpu_times().user)

    def close(self) -> None:
        """End everything."""
        self._page.close()
        super().close()
        self._begun.close()

    def _answers(self) -> bool:
        try:
            return self._page.get("/api/health").is_success
        except httpx.TransportError:
            return False
