"""Which robots a demo has, and what starts them."""

import argparse
import threading
from pathlib import Path

import pytest

from rolling_panda.cli import demo
from rolling_panda.cli.demo_robots import check_count, commands, demo_robots
from rolling_panda.errors import InputError
from tests.support.live_robot import free_port

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
    started = commands((robot,), given, ["--connect", "tls/127.0.0.1:1"], Path("/run/token"))
    assert set(started) == {"bridge", "controller", "perception", "server"}
    assert all(words(command, "--robot-id") == ["rp1"] for command in started.values())
    assert words(started["server"], "--also-robot-id") == []


def test_each_of_several_has_a_name_a_row_a_folder_and_a_trace_of_its_own() -> None:
    given = arguments("--robots", "3", "--state", "/kept", "--trace", "/kept/t.csv", "--seed", str(2**32 - 1))
    robots = demo_robots(given, Path("/run"))
    assert [robot.name for robot in robots] == ["panda-1", "panda-2", "panda-3"]
    assert [robot.seed for robot in robots] == [2**32 - 1, 0, 1]
    started = commands(robots, given, ["--connect", "tls/127.0.0.1:1"], Path("/run/token"))
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
        check_count(arguments(*argv))


class Played:
    """Stands where child processes and the wire would be: every process is up at its second look."""

    def __init__(self, *named: object) -> None:
        self.started: list[str] = []
        self.robot = named[1] if len(named) > 1 else ""
        self.looks = 0

    def start(self, name: str, command: list[str]) -> None:
        self.started.append(name)

    def death(self) -> None:
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
    supervisor = Played()
    stopping = threading.Event()
    monkeypatch.setattr(demo, "Supervisor", lambda folder: supervisor)
    monkeypatch.setattr(demo, "Readiness", Played)
    monkeypatch.setattr(demo, "_accepts", lambda port: True)
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
    assert supervisor.started[0] == "router" and supervisor.started[-1] == "ended" and len(supervisor.started) == 9
