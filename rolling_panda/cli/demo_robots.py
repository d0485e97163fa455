"""The robots of a demo: their names, and what starts the processes of each."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import python_command
from rolling_panda.topics import ROBOT_ID

#: Each has a bridge, a controller and a perception of its own: more than this no one computer keeps in time.
MOST = 4


@dataclass(frozen=True)
class DemoRobot:
    """One simulated robot, in a row of its own.

    Attributes:
        name: On the wire and on the page.
        prefix: Of the names of its processes in what the demo says and in its logs.
        seed: Of its row.
        state: Where it keeps what survives a restart.
        trace: Where it records what was really actuated; None = nowhere.
    """

    name: str
    prefix: str
    seed: int
    state: Path
    trace: Path | None


def check_count(arguments: argparse.Namespace) -> None:
    """Refuse as many robots as cannot be started.

    Raises:
        InputError: Too many or too few, or the devices are faked, which is done for one robot.
    """
    count: int = arguments.robots
    if not 1 <= count <= MOST:
        raise InputError(f"--robots {count} is not possible here; give 1 to {MOST}")
    if count > 1 and arguments.fakes:
        raise InputError(f"--robots {count} with --fakes: devices are faked for one robot; leave out one of the two")


def demo_robots(arguments: argparse.Namespace, folder: Path) -> tuple[DemoRobot, ...]:
    """As many as were asked for. One alone has the usual name; of several each has a folder and a trace of its own.

    Args:
        arguments: Of the demo.
        folder: Of this run: a row is grown anew for each, and what was done in another one says nothing about it.
    """
    state: Path = (arguments.state or folder / "state").resolve()
    trace: Path | None = arguments.trace.resolve() if arguments.trace else None
    if arguments.robots == 1:
        return (DemoRobot(ROBOT_ID, "", arguments.seed, state, trace),)
    names = [f"panda-{number}" for number in range(1, arguments.robots + 1)]
    return tuple(
        DemoRobot(
            name,
            f"{name}-",
            (arguments.seed + index) % 2**32,
            state / name,
            None if trace is None else trace.with_name(f"{trace.stem}-{name}{trace.suffix}"),
        )
        for index, name in enumerate(names)
    )


def commands(
    robots: tuple[DemoRobot, ...], arguments: argparse.Namespace, wire: list[str], token_file: Path
) -> dict[str, list[str]]:
    """What starts each process of these robots, and the one server for all of them, by the name of its log.

    Args:
        robots: Of the demo.
        arguments: Of the demo.
        wire: Options that say where the wire is and how it is protected.
        token_file: With the token of the first sign-in link.
    """
    shared = ["--config", str(arguments.config.resolve()), *wire, "--exit-with-parent"]
    found: dict[str, list[str]] = {}
    for robot in robots:
        own = ["--robot-id", robot.name, "--state", str(robot.state), *shared]
        traced = [] if robot.trace is None else ["--trace", str(robot.trace)]
        simulated = ["sim", "--seed", str(robot.seed), *traced]
        found[f"{robot.prefix}bridge"] = python_command(
            "bridge", [*own, *(["real", "--fakes"] if arguments.fakes else simulated)]
        )
        for process in ("controller", "perception"):
            found[f"{robot.prefix}{process}"] = python_command(process, own)
    first, *others = robots
    known = ["--robot-id", first.name, *(word for robot in others for word in ("--also-robot-id", robot.name))]
    page = ["--port", str(arguments.port), "--sign-in-token-file", str(token_file)]
    found["server"] = python_command("server", [*known, "--state", str(first.state), *shared, *page])
    return found
