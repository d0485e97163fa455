"""The five processes on loopback, started one by one over real Zenoh, so that one can watch, stop or kill any."""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import httpx

from tests.support.processes.local_router import free_port
from tests.support.processes.processes import Processes

PROCESSES = ("router", "bridge", "controller", "perception", "server")
TOKEN = "for-this-test-only-0123456789abcdefghijklmnop"


class LiveRobot(Processes):
    """Router, bridge, controller, perception and server, each a process of its own."""

    def __init__(
        self, folder: Path, seed: int = 0, config: Path | None = None, certificates: Path | None = None
    ) -> None:
        """Start nothing yet.

        Args:
            folder: For logs, state and trace.
            seed: Of the row.
            config: TOML configuration; None takes the simulation's.
            certificates: Folder of them, for mutual TLS on the wire; None for a plain one.
        """
        super().__init__(folder)
        self.seed = seed
        self.config, self.certificates = config, certificates
        self.port, self.router_port = free_port(), free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.endpoint = f"{'tcp' if certificates is None else 'tls'}/127.0.0.1:{self.router_port}"
        self.trace = folder / "trace"
        self._client: httpx.Client | None = None

    def __enter__(self) -> Self:
        """Start everything and wait until the server answers."""
        with ExitStack() as undo:
            undo.callback(self.close)
            for name in PROCESSES:
                self.start(name)
            self.wait(self._healthy, 60, "the server to answer")
            undo.pop_all()
        return self

    def start(self, name: str) -> None:
        """Start (or start again) one process; its output goes to a file of its name."""
        token = self.folder / "token"
        options = {
            "router": ["--listen", self.endpoint],
            "bridge": ["sim", "--seed", str(self.seed), "--trace", str(self.trace)],
            "controller": [],
            "perception": [],
            "server": ["--port", str(self.port), "--sign-in-token-file", str(token)],
        }[name]
        if name == "server":
            # Sessions end with the server that knew them.
            self._sign_out()
            token.touch(0o600)
            token.write_text(TOKEN)
        if name != "router":
            options += ["--connect", self.endpoint_of(name), "--state", str(self.folder / "state")]
            if self.config is not None:
                options += ["--config", str(self.config)]
        plain = self.certificates is None
        options += ["--plain-wire"] if plain else ["--certificates", str(self.certificates)]
        module, words = ("rolling_panda", ["router", *options]) if name == "router" else (name, options)
        self.launch(name, module, words)

    def endpoint_of(self, name: str) -> str:
        """Where a process finds the wire."""
        return self.endpoint

    def close(self) -> None:
        """End everything, politely first."""
        self._sign_out()
        super().close()

    @property
    def client(self) -> httpx.Client:
        """A signed-in script."""
        if self._client is None:
            self._client = httpx.Client(base_url=self.url, headers={"Origin": self.url}, timeout=5)
            self._client.post("/api/sign-in", json={"token": TOKEN}).raise_for_status()
        return self._client

    def link(self, user: str) -> str:
        """A single-use sign-in link for a browser."""
        return str(self.post("invite", user=user, role="supervisor")["link"])

    def post(self, path: str, **body: Any) -> dict[str, Any]:
        """Ask for something that must be granted."""
        answer = self.client.post(f"/api/{path}", json=body)
        assert answer.status_code == 200, f"{path}: {answer.status_code} {answer.text}\n{self.logs()}"
        return dict(answer.json())

    def state(self) -> dict[str, Any]:
        """What the page would show now."""
        return dict(self.client.get("/api/state").json())

    def mode(self) -> str:
        """State of the supervision machine; empty before the first."""
        controller = self.state()["controller"]
        return str(controller["mode"]) if controller else ""

    def gone(self, name: str) -> dict[str, Any] | None:
        """The server's row about a process that is not connected; None while it is."""
        rows = {row["process"]: row for row in self.state()["processes"]}
        return None if rows[name]["present"] else dict(rows[name])

    def back(self, names: Sequence[str]) -> bool:
        """Whether these processes, started again, are connected."""
        return self._healthy() and all(self.gone(name) is None for name in names)

    def refused(self) -> list[str]:
        """What a process said of messages that it did not take: none where all speak the same language."""
        told = self.client.get("/api/events").json()["events"]
        return [line["text"] for line in told if line["text"].lower().startswith(("refused a message", "refused on"))]

    def driving(self) -> bool:
        """Whether the base moves at a good part of its speed, in automatic work."""
        state = self.state()
        joints, controller = state["joints"], state["controller"]
        return bool(
            joints and controller and controller["mode"] == "AUTO" and min(map(abs, joints["velocity"][:2])) > 0.6
        )

    @staticmethod
    def clock() -> float:
        """The monotonic clock that all processes of the machine share (s)."""
        return time.monotonic()

    def points(self) -> list[dict[str, Any]]:
        """The queue, in the order of work."""
        return list(self.client.get("/api/points").json()["points"])

    def logs(self) -> str:
        """The last lines of every process and of the page's log."""
        server, parts = self.processes.get("server"), [super().logs()]
        if self._client is not None and server is not None and server.poll() is None:
            told = self._client.get("/api/events").json()["events"][-25:]
            parts.append("--- log\n" + "\n".join(f"{line['process']}: {line['text']}" for line in told))
        return "\n".join(parts)

    def _sign_out(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None

    def _healthy(self) -> bool:
        try:
            return httpx.get(f"{self.url}/api/health", timeout=1).status_code == 200
        except httpx.HTTPError:
            return False
