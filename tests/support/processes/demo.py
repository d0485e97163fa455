"""The running demo: its processes, and a script signed in to it as its operator."""

import contextlib
import re
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import psutil

from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support.processes.local_router import free_port

#: The longest start on a busy machine (s).
STARTUP_S = 60.0
CHILDREN = frozenset({"router", "bridge", "controller", "perception", "server"})
#: How often somebody who looks on asks for the robot's state (s).
_LOOK_S = 0.2


class DemoProcess:
    """The demo and the processes that it starts; leaves nothing behind."""

    def __init__(self, port: int, *more: str, folder: Path | None = None) -> None:
        """Start it; `wait_until_up` waits.

        Args:
            port: Of the page.
            more: Other options of the demo.
            folder: For its temporary files; None takes the system's.
        """
        self.url = f"http://127.0.0.1:{port}"
        self.words: list[str] = []
        self._popen = subprocess.Popen(
            python_command("rolling_panda", ["demo", "--port", str(port), *more]),
            env=child_environment() | ({} if folder is None else {"TMPDIR": str(folder)}),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.pid = self._popen.pid
        self.children: list[psutil.Process] = []

    def wait_until_up(self, limit_s: float = STARTUP_S) -> None:
        """Wait until every process is up.

        Raises:
            InputError: It did not come up within `limit_s`.
        """
        assert self._popen.stdout is not None
        began = time.monotonic()
        for line in self._popen.stdout:
            self.words.append(line)
            if "Ctrl-C ends everything" in line:
                break
        else:
            raise InputError(f"the demo did not come up:\n{self.text()}")
        if time.monotonic() - began > limit_s:
            raise InputError(f"the demo took longer than {limit_s:.0f} s to come up:\n{self.text()}")
        self.children = psutil.Process(self.pid).children(recursive=True)
        for name in CHILDREN:
            assert all(child.is_running() for child in self.named(name)), self.text()

    def text(self) -> str:
        """What it has said."""
        return "".join(self.words)

    def child(self, name: str) -> psutil.Process:
        """Its one process of this name."""
        (found,) = self.named(name)
        return found

    def named(self, name: str) -> list[psutil.Process]:
        """Its processes of this name: one, or one a robot."""
        module = ["rolling_panda", "router"] if name == "router" else [name]
        found = [child for child in self.children if child.cmdline()[3 : 3 + len(module)] == module]
        assert found, f"no {name}:\n{self.text()}"
        return found

    def ends(self, limit_s: float = 5.0) -> int:
        """Exit code, once the demo and all that it started are gone within the limit."""
        began = time.monotonic()
        code = self._popen.wait(limit_s)
        psutil.wait_procs(self.children, timeout=max(0.0, limit_s - (time.monotonic() - began)))
        assert not [child.cmdline() for child in self.children if child.is_running()]
        assert self._popen.stdout is not None
        self.words.append(self._popen.stdout.read())
        return code

    def close(self) -> None:
        """End it as Ctrl-C does."""
        if self._popen.poll() is None:
            self._popen.terminate()
        self._popen.communicate()
        for child in self.children:
            if child.is_running():
                child.kill()


class TracedDemo(DemoProcess):
    """A demo on a free port, which records what its robots do in `trace`."""

    def __init__(self, folder: Path, *more: str) -> None:
        """Start it with its temporary folder in this one, to be removed with it."""
        self.port, self.trace = free_port(), folder / "trace"
        super().__init__(self.port, "--trace", str(self.trace), *more, folder=folder)


@contextlib.contextmanager
def running_demo(folder: Path, *more: str, limit_s: float = STARTUP_S) -> Iterator[TracedDemo]:
    """A demo that is up."""
    demo = TracedDemo(folder, *more)
    try:
        demo.wait_until_up(limit_s)
        yield demo
    finally:
        demo.close()


class Demo(DemoProcess):
    """A demo under measurement, and a script signed in to it; with several robots, one script for each.

    A session holds one robot at a time.
    """

    def __init__(self, port: int, seed: int, config: Path | None = None, *more: str, points: int = 2) -> None:
        """Start it and wait until detections have come.

        Args:
            port: Of the page.
            seed: Of the row.
            config: TOML configuration; None takes the simulation's.
            more: Other options of the demo.
            points: How many detections to wait for; 0 where something stands before the row.

        Raises:
            InputError: It did not come up; the text is what it said.
        """
        chosen = [] if config is None else ["--config", str(config)]
        super().__init__(port, "--seed", str(seed), *more, *chosen)
        self.tree = psutil.Process(self.pid)
        self.client = httpx.Client(base_url=self.url, headers={"Origin": self.url}, timeout=10)
        #: Who holds each robot.
        self.scripts = [self.client]
        try:
            self._sign_in(points)
        except BaseException:
            # Nobody has it yet who could close it.
            self.close()
            raise

    def _sign_in(self, points: int) -> None:
        self.wait_until_up(180.0)
        token = re.search(r"/sign-in\?token=(\S+)", self.text())
        wire = re.search(r"--connect (\S+) --certificates (\S+)", self.text())
        assert token is not None and wire is not None, self.text()
        #: Where the robot's wire is, and what it takes to hear it.
        self.wire = TransportConfig(connect=(wire[1],), certificates=wire[2])
        self.client.post("/api/sign-in", json={"token": token[1]}).raise_for_status()
        several = self.client.get("/api/robots")
        #: Below which each robot's requests are.
        self.paths = [row["path"].rstrip("/") for row in several.json()] if several.is_success else [""]
        for number in range(1, len(self.paths)):
            cookie = self.guest(f"script-{number + 1}", "supervisor")
            self.scripts.append(
                httpx.Client(base_url=self.url, headers={"Origin": self.url, "Cookie": cookie}, timeout=10)
            )
        self.wait(lambda: all(len(self._points(path)) >= points for path in self.paths), 90.0)

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

    @contextlib.contextmanager
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
        super().close()
