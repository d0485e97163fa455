"""A running demo that is measured, and a script signed in to it as its operator."""

import re
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import psutil

from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command

#: How often somebody who looks on asks for the robot's state (s).
_LOOK_S = 0.2


class Demo:
    """A demo under measurement, and a script signed in to it; with several robots, one script for each.

    A session holds one robot at a time.
    """

    def __init__(self, port: int, seed: int, config: Path | None = None, *more: str) -> None:
        """Start it and wait until detections have come.

        Args:
            port: Of the page.
            seed: Of the row.
            config: TOML configuration; None takes the simulation's.
            more: Other options of the demo.

        Raises:
            InputError: It did not come up; the text is what it said.
        """
        words = ["demo", "--port", str(port), "--seed", str(seed), *more]
        if config is not None:
            words += ["--config", str(config)]
        self._popen = subprocess.Popen(
            python_command("rolling_panda", words),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=child_environment(),
        )
        self.tree = psutil.Process(self._popen.pid)
        self.url = f"http://127.0.0.1:{port}"
        self.client = httpx.Client(base_url=self.url, headers={"Origin": self.url}, timeout=10)
        said = ""
        assert self._popen.stdout is not None
        for line in self._popen.stdout:
            said += line
            token = re.search(r"/sign-in\?token=(\S+)", line)
            if token:
                break
        else:
            raise InputError(f"the demo did not come up:\n{said}")
        wire = re.search(r"--connect (\S+) --certificates (\S+)", said)
        assert wire is not None, said
        #: Where the robot's wire is, and what it takes to hear it.
        self.wire = TransportConfig(connect=(wire[1],), certificates=wire[2])
        self.client.post("/api/sign-in", json={"token": token[1]}).raise_for_status()
        several = self.client.get("/api/robots")
        #: Below which each robot's requests are.
        self.paths = [row["path"].rstrip("/") for row in several.json()] if several.is_success else [""]
        #: Who holds each robot.
        self.scripts = [self.client]
        for number in range(1, len(self.paths)):
            cookie = self.guest(f"script-{number + 1}", "supervisor")
            self.scripts.append(
                httpx.Client(base_url=self.url, headers={"Origin": self.url, "Cookie": cookie}, timeout=10)
            )
        self.wait(lambda: all(len(self._points(path)) >= 2 for path in self.paths), 90.0)

    def wait(self, condition: Callable[[], Any], limit_s: float) -> None:
        """Poll until `condition()` holds.

        Raises:
            InputError: It did not within `limit_s`.
        """
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise InputError(f"the demo did not get there within {limit_s:.0f} s")
            time.sleep(0.1)

    def post(self, path: str, **body: Any) -> dict[str, Any]:
        """Ask for something that must be granted; the answer of the last robot.

        Raises:
            InputError: It was not.
        """
        for script, robot in zip(self.scripts, self.paths, strict=True):
            answer = script.post(f"{robot}/api/{path}", json=body)
            if not answer.is_success:
                raise InputError(f"{robot}/api/{path} was refused: {answer.text}")
        return dict(answer.json())

    def state(self) -> dict[str, Any]:
        """That of the first robot."""
        return self.states()[0]

    def _points(self, path: str) -> list[Any]:
        return list(self.client.get(f"{path}/api/points").json()["points"])

    def states(self) -> list[dict[str, Any]]:
        """What the page of each robot would show now."""
        return [dict(self.client.get(f"{path}/api/state").json()) for path in self.paths]

    def in_mode(self, mode: str) -> bool:
        """Is the supervision machine of every robot there?"""
        return all(state["controller"]["mode"] == mode for state in self.states())

    def guest(self, user: str, role: str) -> str:
        """Somebody else signs in; their cookie."""
        answer = self.client.post(f"{self.paths[0]}/api/invite", json={"user": user, "role": role})
        token = answer.raise_for_status().json()["link"].split("token=")[1]
        with httpx.Client(base_url=self.url, headers={"Origin": self.url}, trust_env=False) as client:
            client.post("/api/sign-in", json={"token": token}).raise_for_status()
            return "; ".join(f"{name}={value}" for name, value in client.cookies.items())

    def log(self, lines: int) -> list[str]:
        """The newest lines of the log."""
        told = self.client.get("/api/events").json()["events"]
        return [f"{line['process']}: {line['text']}" for line in told[-lines:]]

    def begin_work(self) -> None:
        """Arm, accept all that was detected, start."""
        self.post("arm")
        self.wait(lambda: self.in_mode("READY"), 20.0)
        self.post("points/accept-all", confidence=0.0)
        # Not before a picture of what stands around has come, which takes a while on a busy machine.
        self.wait(lambda: all("Start" in state["controller"]["allowed"] for state in self.states()), 30.0)
        self.post("start")

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Somebody looks on: without anybody who asks for the robot's state, work is paused after a second."""
        ended = threading.Event()

        def look() -> None:
            while not ended.wait(_LOOK_S):
                for script, path in zip(self.scripts, self.paths, strict=True):
                    script.get(f"{path}/api/state")

        thread = threading.Thread(target=look, name="somebody who looks on")
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def close(self) -> None:
        """End it as Ctrl-C does."""
        for script in self.scripts:
            script.close()
        self._popen.terminate()
        self._popen.wait(15)
        assert self._popen.stdout is not None
        self._popen.stdout.close()
