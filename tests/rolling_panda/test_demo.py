"""The demo: its robots and their commands, and with real processes its start and its end."""

import argparse
import os
import re
import signal
import socket
import stat
import subprocess
import threading
from pathlib import Path

import httpx
import pytest

from rolling_panda.cli import demo
from rolling_panda.cli import main as cli
from rolling_panda.cli.demo import _check_robots, choose_router_port, demo_robots, process_commands, write_secret
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support.processes.demo import CHILDREN, STARTUP_S, running_demo
from tests.support.processes.local_router import free_port


@pytest.mark.long
@pytest.mark.paced
def test_it_comes_up_with_a_link_that_works_once_and_ctrl_c_ends_it(tmp_path: Path) -> None:
    with running_demo(tmp_path) as demo:
        for name in CHILDREN:
            assert re.search(rf"^  {name} +up +\d+\.\d s$", demo.text(), re.MULTILINE)
        (link,) = re.findall(r"http://\S+", demo.text())
        page, token = link.split("/sign-in?token=")
        assert page == f"http://127.0.0.1:{demo.port}"
        assert not [child for child in demo.children if token in " ".join(child.cmdline())]
        assert not list(tmp_path.rglob("sign-in-token")), "the server deletes the token once read"
        statuses = [sign_in(page, token) for _ in range(2)]
        assert statuses[0] < 300 and statuses[1] == 401
        (words,) = re.findall(r"rolling-panda (status --connect .*)$", demo.text(), re.MULTILINE)
        assert cli.main(words.split()) == 0
        os.kill(demo.pid, signal.SIGINT)
        assert demo.ends() == 0
        assert "every process has ended" in demo.text()
        assert not list(tmp_path.glob("rolling-panda-*")), "what went well leaves nothing behind"
        assert demo.trace.stat().st_size > 0


def sign_in(page: str, token: str) -> int:
    return httpx.post(
        f"{page}/api/sign-in", json={"token": token}, headers={"Origin": page}, trust_env=False
    ).status_code


# One more start of everything; what it is made of is tested in `test_child_processes.py`.
@pytest.mark.slow
@pytest.mark.paced
def test_when_a_process_is_killed_it_says_which_and_ends_the_rest(tmp_path: Path) -> None:
    with running_demo(tmp_path) as demo:
        # The bridge has a process of its own for pictures, which must not be left either.
        demo.child("bridge").kill()
        assert demo.ends() == 1
        assert "bridge ended by signal 9 (SIGKILL)" in demo.text()
        assert "Traceback" not in demo.text()
        (folder,) = tmp_path.glob("rolling-panda-*")
        assert f"The logs of all processes are kept in {folder}" in demo.text()
        assert (folder / "bridge.log").exists()


# Children that watch their parent are tested in test_child_processes.py, which takes less time.
@pytest.mark.slow
@pytest.mark.paced
def test_when_the_demo_itself_is_killed_nothing_outlives_it(tmp_path: Path) -> None:
    with running_demo(tmp_path) as demo:
        os.kill(demo.pid, signal.SIGKILL)
        assert demo.ends() == -signal.SIGKILL


@pytest.mark.long
@pytest.mark.paced
def test_a_process_that_cannot_start_is_told_with_its_reason(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[bridge]\nwatchdogs = 1\n")
    done = subprocess.run(
        python_command("rolling_panda", ["demo", "--port", str(free_port()), "--config", str(config)]),
        env=child_environment() | {"TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=STARTUP_S,
    )
    assert done.returncode == 1
    assert "bridge ended with exit code 1" in done.stdout
    assert "[bridge] has no key 'watchdogs'" in done.stdout
    assert list(tmp_path.glob("rolling-panda-*/*.log")), "the logs are kept"
    assert not list(tmp_path.rglob("*.key")), "no key outlives its run"
    assert "Traceback" not in done.stdout + done.stderr


def test_the_router_is_where_other_commands_look_unless_that_port_is_taken() -> None:
    usual = free_port()
    endpoint = f"tcp/127.0.0.1:{usual}"
    assert choose_router_port(endpoint) == usual
    with socket.create_server(("127.0.0.1", usual)):
        assert choose_router_port(endpoint) not in (usual, 0)


def test_a_secret_is_for_this_user_alone_and_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    write_secret(path, "abc")
    assert path.read_text() == "abc"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(FileExistsError):
        write_secret(path, "def")


PROCESSES = ("bridge", "controller", "perception")


def arguments(*argv: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    demo.add_arguments(parser)
    return parser.parse_args(["--config", "c.toml", *argv])


def words(command: list[str], option: str) -> list[str]:
    return [command[index + 1] for index, word in enumerate(command) if word == option]


def test_one_robot_is_started_as_ever() -> None:
    given = arguments("--trace", "t.csv", "--seed", "3")
    (robot,) = demo_robots(given, Path("/run"))
    assert (robot.name, robot.seed, robot.state, robot.trace) == ("rp1", 3, Path("/run/state"), Path("t.csv").resolve())
    started = process_commands((robot,), given, ["--connect", "tls/127.0.0.1:1"], Path("/run/token"))
    assert set(started) == {"bridge", "controller", "perception", "server"}
    assert all(words(command, "--robot-id") == ["rp1"] for command in started.values())
    assert words(started["server"], "--also-robot-id") == []


def test_each_of_several_has_a_name_a_row_a_folder_and_a_trace_of_its_own() -> None:
    given = arguments("--robots", "3", "--state", "/kept", "--trace", "/kept/t.csv", "--seed", str(2**32 - 1))
    robots = demo_robots(given, Path("/run"))
    assert [robot.name for robot in robots] == ["panda-1", "panda-2", "panda-3"]
    assert [robot.seed for robot in robots] == [2**32 - 1, 0, 1]
    started = process_commands(robots, given, ["--connect", "tls/127.0.0.1:1"], Path("/run/token"))
    assert len(started) == 10
    for robot in robots:
        for process in ("bridge", "controller", "perception"):
            command = started[f"{robot.name}-{process}"]
            assert process in command
            assert words(command, "--robot-id") == [robot.name]
            assert words(command, "--state") == [f"/kept/{robot.name}"]
        assert words(started[f"{robot.name}-bridge"], "--trace") == [f"/kept/t-{robot.name}.csv"]
    assert words(started["server"], "--robot-id") == ["panda-1"]
    assert words(started["server"], "--also-robot-id") == ["panda-2", "panda-3"]


@pytest.mark.parametrize(
    "argv", [("--robots", "0"), ("--robots", "5"), ("--robots", "2", "--bridge", "real", "--fakes")]
)
def test_more_robots_than_can_be_are_refused(argv: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match=f"--robots {argv[1]}"):
        _check_robots(arguments(*argv))


class Played:
    """Stands where child processes and the wire would be: every process is up at its second look."""

    def __init__(self, *named: object) -> None:
        self.started: list[str] = []
        self.robot = named[1] if len(named) > 1 else ""
        self.looks = 0

    def start(self, name: str, command: list[str]) -> None:
        self.started.append(name)

    def exited(self) -> None:
        return None

    def end(self) -> None:
        self.started.append("ended")

    def up(self) -> frozenset[str]:
        self.looks += 1
        # The second robot hears of the server last.
        needed = 4 if self.robot == "panda-2" else 2
        there = {"bridge", "controller", "perception"} if self.looks > 1 else set()
        return frozenset(there | ({"server"} if self.looks >= needed else set()))

    def __enter__(self) -> "Played":
        return self

    def __exit__(self, *_: object) -> None:
        return


def test_the_demo_says_when_each_is_up_and_the_server_once_every_robot_hears_of_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    children = Played()
    stopping = threading.Event()
    monkeypatch.setattr(demo, "ChildProcesses", lambda folder: children)
    monkeypatch.setattr(demo, "Readiness", Played)
    monkeypatch.setattr(demo, "_is_listening", lambda port: True)
    monkeypatch.setattr(demo, "_POLL_S", 0.001)
    monkeypatch.setattr(demo, "stop_on_signals", lambda: stopping)
    threading.Timer(0.5, stopping.set).start()
    given = arguments("--robots", "2", "--port", str(free_port()))
    given.config = None
    assert demo.run(given) == 0
    said = capsys.readouterr().out
    order = [line.split()[0] for line in said.splitlines() if " up " in line]
    assert order[0] == "router" and order[-1] == "server"
    assert set(order[1:-1]) == {f"{name}-{each}" for name in ("panda-1", "panda-2") for each in PROCESSES}
    assert "--robot-id panda-2" in said and said.count("/sign-in?token=") == 1
    assert children.started[0] == "router" and children.started[-1] == "ended" and len(children.started) == 9
