"""`rolling-panda demo`: the whole program on this machine, in simulation, until Ctrl-C or until one process ends."""

import argparse
import contextlib
import os
import secrets
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rolling_panda import __version__
from rolling_panda.cli.child_processes import ChildExit, ChildProcesses
from rolling_panda.cli.status import Readiness
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.resources import resource
from rolling_panda.runtime.launch import python_command
from rolling_panda.runtime.process import stop_on_signals
from rolling_panda.topics import ROBOT_ID
from rolling_panda.transport.certificates import make
from rolling_panda.transport.settings import DEFAULT_ENDPOINT, PLAIN_WARNING

#: Time limit for the start of all processes (s).
STARTUP_S = 120.0
_POLL_S = 0.1
#: One computer keeps no more robots in real time: each has its own bridge, controller and perception.
MAX_ROBOTS = 4
#: Keys of the devices that the bridge's drivers use (`bridge.real`, assets/config/fakes.toml).
FIELD = (
    "cmd_vel",
    "set_EMstop",
    "unset_EMstop",
    "drives/joint_states",
    "odom",
    "emergency_stop_state",
    "battery_state",
    "cutter/close",
    "fake-camera/exposure",
    "fake-camera/inertial",
)
_HOST = "127.0.0.1"


@dataclass(frozen=True)
class DemoRobot:
    """A simulated robot in its own row.

    Attributes:
        name: On the wire and on the page.
        prefix: Of the names of its processes in the output and of their logs.
        seed: Of its row.
        state: Folder of the state that survives a restart.
        trace: File of the recorded actuation; None for none.
    """

    name: str
    prefix: str
    seed: int
    state: Path
    trace: Path | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the demo."""
    parser.add_argument("--port", type=int, default=8000, help="port of the operator's page (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="which vineyard row to grow (default: %(default)s)")
    parser.add_argument(
        "--robots", type=int, default=1, metavar="N", help="number of robots, each in its own row (default: 1)"
    )
    parser.add_argument("--trace", type=Path, metavar="FILE", help="record the actuation of each step there")
    parser.add_argument(
        "--state",
        type=Path,
        metavar="DIR",
        help="folder for what survives a restart (default: a temporary one)",
    )
    parser.add_argument("--bridge", choices=("sim", "real"), default="sim", help="which bridge (default: sim)")
    parser.add_argument(
        "--fakes",
        action="store_true",
        help="with --bridge real: its drivers on fakes of the devices",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="TOML configuration (default: the bridge's own)")
    parser.add_argument(
        "--plain-wire",
        action="store_true",
        help="no certificates: every program on this machine can move the robot (default: certificates of this run)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Start all processes, print the sign-in link, wait, and end all processes.

    Returns:
        0 after a signal, 1 when a process ended by itself or did not start.

    Raises:
        InputError: The port is taken, or a file cannot be used.
        ConfigError: The configuration is missing or wrong.
    """
    arguments.config = arguments.config or default_config(arguments)
    check(arguments)
    stopping = stop_on_signals()
    folder = Path(tempfile.mkdtemp(prefix="rolling-panda-"))
    robots = demo_robots(arguments, folder)
    children = ChildProcesses(folder)
    mode = "the real bridge on fakes of the devices" if arguments.fakes else "simulation"
    _print(f"Rolling Panda {__version__}: {mode}, seed {arguments.seed}")
    _print(f"Logs of the processes are in {folder}, for as long as it runs and after a failure")
    if arguments.plain_wire:
        _print(PLAIN_WARNING)
    token_file, certificates = folder / "sign-in-token", folder / "certificates"
    try:
        if not arguments.plain_wire:
            make(certificates, (_HOST,), None, [robot.name for robot in robots])
        exited = _start_and_watch(arguments, robots, children, token_file, stopping)
    finally:
        children.end()
        token_file.unlink(missing_ok=True)
        shutil.rmtree(certificates, ignore_errors=True)
    if exited is None:
        shutil.rmtree(folder, ignore_errors=True)
        _print("\nStopped; every process has ended.")
        return 0
    _print(f"\n{exited.name} ended {exited.cause}; everything else was stopped. It said last:")
    _print("\n".join(f"  | {line}" for line in (exited.output or "(nothing)").splitlines()))
    _print(f"The logs of all processes are kept in {folder}")
    return 1


def default_config(arguments: argparse.Namespace) -> Path:
    """The configuration of the chosen bridge."""
    return resource("assets/config/fakes.toml" if arguments.bridge == "real" else "assets/config/sim.toml")


def check(arguments: argparse.Namespace) -> None:
    """Check the arguments before anything is started.

    Raises:
        InputError: The port is taken, a file cannot be used, or a real robot would move.
        ConfigError: The configuration is missing or wrong.
    """
    if (arguments.bridge == "real") != arguments.fakes:
        raise InputError(
            "the demo moves no real robot: `--bridge real --fakes` runs its drivers on fakes of the devices; for the "
            "robot itself start `rolling-panda bridge real` and the other processes one by one (docs/deployment.md)"
        )
    _check_robots(arguments)
    load_section(arguments.config, "transport", TransportConfig)
    load_section(arguments.config, "robot", RobotConfig)
    if not 1 <= arguments.port <= 65535:
        raise InputError(f"--port {arguments.port} is not a port; give one from 1 to 65535")
    if not 0 <= arguments.seed < 2**32:
        raise InputError(f"--seed {arguments.seed} is out of range; give one from 0 to {2**32 - 1}")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, arguments.port))
            probe.listen()
        except OSError as error:
            raise InputError(
                f"port {arguments.port} cannot be used ({error.strerror}); give another one with --port"
            ) from error
    if arguments.trace is not None:
        _check_writable(arguments.trace)


def _check_robots(arguments: argparse.Namespace) -> None:
    count: int = arguments.robots
    if not 1 <= count <= MAX_ROBOTS:
        raise InputError(f"--robots {count} is not possible here; give 1 to {MAX_ROBOTS}")
    if count > 1 and arguments.fakes:
        raise InputError(f"--robots {count} with --fakes: devices are faked for one robot; leave out one of the two")


def _check_writable(path: Path) -> None:
    if path.is_dir():
        raise InputError(f"--trace {path} is a folder; give the name of a file")
    if not path.resolve().parent.is_dir():
        raise InputError(f"--trace {path}: there is no folder {path.resolve().parent}; make it first")
    if not os.access(path if path.exists() else path.resolve().parent, os.W_OK):
        raise InputError(f"--trace {path} cannot be written; choose another place")


def _start_and_watch(
    arguments: argparse.Namespace,
    robots: tuple[DemoRobot, ...],
    children: ChildProcesses,
    token_file: Path,
    stopping: threading.Event,
) -> ChildExit | None:
    """Returns the child whose exit ended the run; None after a signal."""
    started_at = time.monotonic()
    page = f"http://{_HOST}:{arguments.port}"
    router_port = choose_router_port(DEFAULT_ENDPOINT)
    endpoint = f"{'tcp' if arguments.plain_wire else 'tls'}/{_HOST}:{router_port}"
    folder = token_file.with_name("certificates")
    wire_options = ["--plain-wire"] if arguments.plain_wire else ["--certificates", str(folder)]
    options = ["router", "--listen", endpoint, "--exit-with-parent", *wire_options]
    options += [option for robot in robots for option in ("--robot", robot.name)]
    options += [option for name in FIELD for option in ("--field", name)] if arguments.fakes else []
    children.start("router", python_command("rolling_panda", options))
    while not _is_listening(router_port):
        if children.exited() is not None or stopping.wait(_POLL_S):
            return children.exited()
        if time.monotonic() - started_at > STARTUP_S:
            raise InputError(f"the router did not listen within {STARTUP_S:.0f} s; its log is {children.log('router')}")
    _progress("router", started_at)
    for robot in robots:
        robot_option = f" --robot-id {robot.name}" if robot.prefix else ""
        owner = f"The wire of {robot.name}" if robot.prefix else "The robot's wire"
        status = f"rolling-panda status --connect {endpoint} {' '.join(wire_options)}{robot_option}"
        _print(f"  {owner} is at {endpoint}: {status}")

    if arguments.fakes:
        children.start("fakes", python_command("bridge.fakes", [*_fakes_arguments(arguments, endpoint), *wire_options]))
    token = secrets.token_urlsafe(32)
    write_secret(token_file, token)
    for name, command in process_commands(
        robots, arguments, ["--connect", endpoint, *wire_options], token_file
    ).items():
        children.start(name, command)

    with contextlib.ExitStack() as stack:
        transport = TransportConfig(
            connect=(endpoint,),
            certificates="" if arguments.plain_wire else str(folder),
            plain_wire=arguments.plain_wire,
        )
        ready = [(robot, stack.enter_context(Readiness(transport, robot.name, page))) for robot in robots]
        missing = [f"{robot.prefix}{name}" for robot in robots for name in ("bridge", "controller", "perception")]
        missing.append("server")
        while missing:
            if children.exited() is not None or stopping.wait(_POLL_S):
                return children.exited()
            for name in sorted(_up(ready) & set(missing)):
                missing.remove(name)
                _progress(name, started_at)
            if missing and time.monotonic() - started_at > STARTUP_S:
                logs = ", ".join(str(children.log(name)) for name in missing)
                raise InputError(f"not up within {STARTUP_S:.0f} s: {', '.join(missing)}; see {logs}")

    _print(f"\nSign in once with this link, on this machine:\n\n    {page}/sign-in?token={token}\n")
    _print("Ctrl-C ends everything.")
    while children.exited() is None:
        if stopping.wait(_POLL_S):
            return None
    return children.exited()


def _up(ready: Sequence[tuple[DemoRobot, Readiness]]) -> set[str]:
    """Names of the processes that are up; the server counts once it is up on the wire of each robot."""
    by_robot = [(robot.prefix, readiness.up()) for robot, readiness in ready]
    own = {prefix + name for prefix, up in by_robot for name in up - {"server"}}
    return own | ({"server"} if all("server" in up for _, up in by_robot) else set())


def write_secret(path: Path, text: str) -> None:
    """Write a new file that only this user can read; command lines and environments are visible to other users."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(text)


def _fakes_arguments(arguments: argparse.Namespace, endpoint: str) -> list[str]:
    options = ["--config", str(arguments.config.resolve()), "--connect", endpoint, "--seed", str(arguments.seed)]
    return options + ([] if arguments.trace is None else ["--trace", str(arguments.trace.resolve())])


def _progress(name: str, started_at: float) -> None:
    _print(f"  {name:<10} up  {time.monotonic() - started_at:5.1f} s")


def _print(text: str) -> None:
    print(text, flush=True)


def choose_router_port(default: str) -> int:
    """The port of the default endpoint, which other commands use; any free one when it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, int(default.rsplit(":", 1)[1])))
            # Another program may have bound the port with the same option, which only listening detects.
            probe.listen()
        except OSError:
            with socket.socket() as other:
                other.bind((_HOST, 0))
                return int(other.getsockname()[1])
        return int(probe.getsockname()[1])


def _is_listening(port: int) -> bool:
    try:
        with socket.create_connection((_HOST, port), timeout=0.5):
            return True
    except OSError:
        return False


def demo_robots(arguments: argparse.Namespace, folder: Path) -> tuple[DemoRobot, ...]:
    """The robots of a run. A single one has the default name; of several each has its own folder and trace.

    Args:
        arguments: Of the demo.
        folder: Of this run. State is not kept between runs, since each run grows new rows.
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


def process_commands(
    robots: tuple[DemoRobot, ...], arguments: argparse.Namespace, wire: list[str], token_file: Path
) -> dict[str, list[str]]:
    """The command of each process of these robots and of their server, by the name of its log.

    Args:
        robots: Of the demo.
        arguments: Of the demo.
        wire: Options of the wire: endpoint and certificates.
        token_file: Has the token of the first sign-in link.
    """
    shared = ["--config", str(arguments.config.resolve()), *wire, "--exit-with-parent"]
    commands: dict[str, list[str]] = {}
    for robot in robots:
        own = ["--robot-id", robot.name, "--state", str(robot.state), *shared]
        trace = [] if robot.trace is None else ["--trace", str(robot.trace)]
        simulation = ["sim", "--seed", str(robot.seed), *trace]
        commands[f"{robot.prefix}bridge"] = python_command(
            "bridge", [*own, *(["real", "--fakes"] if arguments.fakes else simulation)]
        )
        for process in ("controller", "perception"):
            commands[f"{robot.prefix}{process}"] = python_command(process, own)
    first, *others = robots
    names = ["--robot-id", first.name, *(option for robot in others for option in ("--also-robot-id", robot.name))]
    page = ["--port", str(arguments.port), "--sign-in-token-file", str(token_file)]
    commands["server"] = python_command("server", [*names, "--state", str(first.state), *shared, *page])
    return commands
