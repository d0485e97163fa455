"""The real processes behind a router that can fail, and a script that operates them."""

import json
import threading
import time
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Self

import httpx

from benchmarks.page.crowd import looked_at
from rolling_panda.errors import RollingPandaError
from tests.support.processes.live_robot import PROCESSES, LiveRobot
from tests.support.processes.local_router import free_port
from tests.support.processes.wall_clock import WallClock

#: How often a hand renews its hold (s).
_RENEW_S = 0.04
_BACK_S = 20.0


class FaultyRobot(LiveRobot):
    """`LiveRobot` with a door of its own for each process; every start of the bridge writes a trace of its own."""

    def __init__(self, folder: Path, seed: int = 0, config: Path | None = None) -> None:
        """Start nothing yet; as `LiveRobot`."""
        super().__init__(folder, seed, config)
        self._doors = {name: f"tcp/127.0.0.1:{free_port()}" for name in PROCESSES if name != "router"}
        self.traces: list[Path] = []
        self.wall_clock = WallClock(folder)

    def start(self, name: str) -> None:
        """Start (or start again) one process."""
        if name == "router":
            doors = [word for name, endpoint in self._doors.items() for word in ("--door", f"{name}={endpoint}")]
            self.launch(name, "benchmarks.faults.faulty_router", doors, answers=True)
            self.answer(name)
            # The others' wall clock can be set.
            self.environment |= self.wall_clock.environment
            return
        if name == "bridge":
            self.trace = self.folder / f"trace{len(self.traces)}"
            self.traces.append(self.trace)
        super().start(name)

    def endpoint_of(self, name: str) -> str:
        """The process's own door."""
        return self._doors[name]

    def order(self, **words: Any) -> float:
        """Tell the router what is to go wrong; returns when it was so (s, monotonic)."""
        self.answer("router", json.dumps(words))
        return time.monotonic()

    def spoil(self, origin: str, to: str, topic: str, **fault: Any) -> float:
        """A fault on the way of a topic; returns when it began (s, monotonic)."""
        return self.order(**{"from": origin, "to": to, "topic": topic, "fault": fault})

    def looked_at(self, pages: int) -> AbstractContextManager[None]:
        """So many pages look on meanwhile, a fifth of which never read."""
        cookie = "; ".join(f"{name}={value}" for name, value in self.client.cookies.items())
        return looked_at(self.url, cookie, pages, pages // 5) if pages else nullcontext()

    def make_ready(self) -> None:
        """Undo every fault of the ways and the clock, and lead the robot back to READY, as a supervisor would.

        Raises:
            RollingPandaError: It does not come back.
        """
        self.order(clear=True)
        self.wall_clock.set(0)
        end = time.monotonic() + _BACK_S
        mode, said = "", ""
        while time.monotonic() < end:
            try:
                mode = self.mode()
                if mode == "READY":
                    return
                said = self._lead_back(mode)
            except httpx.HTTPError as error:
                said = str(error)
            time.sleep(0.1)
        raise RollingPandaError(f"the robot stays in {mode or 'no mode'}: {said}\n{self.logs()}")

    def _lead_back(self, mode: str) -> str:
        asked: dict[str, tuple[str, dict[str, Any]]] = {
            "ESTOP_LATCHED": ("reset", {"reason": "end of a trial"}),
            "PROTECTIVE_STOP": ("acknowledge", {}),
            "FAULT": ("acknowledge", {}),
            "PAUSED": ("resume", {}),
            "IDLE": ("arm", {}),
            "AUTO": ("pause", {}),
        }
        if mode not in asked:
            return ""
        path, body = asked[mode]
        return self.client.post(f"/api/{path}", json=body).text


class Hand:
    """Somebody who holds the base, or only looks on; use it as a context manager."""

    def __init__(self, robot: LiveRobot, linear: float = 0.0) -> None:
        """Drive at `linear` (m/s); 0 looks on and holds nothing."""
        self._client = httpx.Client(
            base_url=robot.url, headers={"Origin": robot.url}, cookies=robot.client.cookies, timeout=2
        )
        self._linear = linear
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._hold)
        #: When the last renewal was answered (s, monotonic).
        self.renewed_at = 0.0
        self._looks = True

    def silence(self) -> float:
        """Say nothing more; returns when the last word was said (s, monotonic)."""
        self._ended.set()
        self._thread.join()
        return self.renewed_at

    def look_away(self) -> float:
        """Be heard, but look at the robot no more; returns when it was last seen (s, monotonic)."""
        self._looks = False
        return self.renewed_at

    def let_go(self) -> float:
        """End the hold; returns when that was said (s, monotonic)."""
        self._ended.set()
        self._thread.join()
        at = time.monotonic()
        self._client.post("/api/teleop", json={"hold": False})
        return at

    def __enter__(self) -> Self:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Let go."""
        self._ended.set()
        self._thread.join()
        if self._linear:
            try:
                self._client.post("/api/teleop", json={"hold": False})
            except httpx.HTTPError:
                # A server that is part of the fault hears nothing; its silence ends the hold.
                pass
        self._client.close()

    def _hold(self) -> None:
        wanted = {"hold": True, "base": {"linear": self._linear, "angular": 0.0}}
        while not self._ended.wait(_RENEW_S):
            try:
                self._client.get("/api/state" if self._looks else "/api/events")
                if self._linear:
                    self._client.post("/api/teleop", json=wanted)
                self.renewed_at = time.monotonic()
            except httpx.HTTPError:
                continue
