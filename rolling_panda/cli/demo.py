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
from pathlib import Path

from rolling_panda import __version__
from rolling_panda.cli.demo_readiness import Readiness
from rolling_panda.cli.demo_robots import DemoRobot, check_count, commands, demo_robots
from rolling_panda.cli.demo_supervisor import Death, Supervisor
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.resources import resource
from rolling_panda.runtime.launch import python_command
from rolling_panda.runtime.process import stop_on_signals
from rolling_panda.transport.certificates import make
from rolling_panda.transport.settings import DEFAULT_ENDPOINT, PLAIN_WARNING

#: A program that is not complete after this long has failed to start (s).
STARTUP_S = 120.0
_POLL_S = 0.1
#: Longer than anybody leaves a demo running.
#: Keys of the devices that the bridge's drivers speak to (`bridge.real`, assets/config/fakes.toml).
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
)
_HOST = "127.0.0.1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the demo."""
    parser.add_argument("--port", type=int, default=8000, help="port of the operator's page (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="which vineyard row to grow (default: %(default)s)")
    parser.add_argument(
        "--robots", type=int, default=1, metavar="N", help="so many robots, each in a row of its own (default: 1)"
    )
    parser.add_argument("--trace", type=Path, metavar="FILE", help="record there what was really actuated, each step")
    parser.add_argument(
        "--state", type=Path, metavar="DIR", help="keep there what survives a restart (default: nothing is kept)"
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
    """Start everything, print the link, supervise, end everything.

    Returns:
        0 when a person ended it, 1 when a process ended by itself or did not come up.

    Raises:
        InputError: The port is taken, or a file cannot be used.
        ConfigError: The configuration is missing or wrong.
    """
    arguments.config = arguments.config or usual_config(arguments)
    check(arguments)
    stopping = stop_on_signals()
    folder = Path(tempfile.mkdtemp(prefix="rolling-panda-"))
    robots = demo_robots(arguments, folder)
    supervisor = Supervisor(folder)
    what = "the real bridge on fakes of the devices" if arguments.fakes else "simulation"
    _say(f"Rolling Panda {__version__}: {what}, seed {arguments.seed}")
    _say(f"Logs of the processes are in {folder}, for as long as it runs and after a failure")
    if arguments.plain_wire:
        _say(PLAIN_WARNING)
    token_file, certificates = folder / "sign-in-token", folder / "certificates"
    try:
        if not arguments.plain_wire:
            make(certificates, (_HOST,), None, [robot.name for robot in robots])
        death = _start_and_watch(arguments, robots, supervisor, token_file, stopping)
    finally:
        supervisor.end()
        token_file.unlink(missing_ok=True)
        shutil.rmtree(certificates, ignore_errors=True)
    if death is None:
        shutil.rmtree(folder, ignore_errors=True)
        _say("\nStopped; every process has ended.")
        return 0
    _say(f"\n{death.name} ended {death.how}; everything else was stopped. It said last:")
    _say("\n".join(f"  | {line}" for line in (death.tail or "(nothing)").splitlines()))
    _say(f"The logs of all processes are kept in {folder}")
    return 1


def usual_config(arguments: argparse.Namespace) -> Path:
    """The configuration that belongs to the bridge asked for."""
    return resource("assets/config/fakes.toml" if arguments.bridge == "real" else "assets/config/sim.toml")


def check(arguments: argparse.Namespace) -> None:
    """Refuse what cannot work before anything is started.

    Raises:
        InputError: The port is taken, a file cannot be used, or a real robot would move.
        ConfigError: The configuration is missing or wrong.
    """
    if (arguments.bridge == "real") != arguments.fakes:
        raise InputError(
            "the demo moves no real robot: `--bridge real --fakes` runs its drivers on fakes of the devices; for the "
            "robot itself start `rolling-panda bridge real` and the other processes one by one (docs/deployment.md)"
        )
    check_count(arguments)
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
    supervisor: Supervisor,
    token_file: Path,
    stopping: threading.Event,
) -> Death | None:
    """What ended the run: a process, or a person (None)."""
    began = time.monotonic()
    page = f"http://{_HOST}:{arguments.port}"
    router_port = choose_router_port(DEFAULT_ENDPOINT)
    endpoint = f"{'tcp' if arguments.plain_wire else 'tls'}/{_HOST}:{router_port}"
    folder = token_file.with_name("certificates")
    closed = ["--plain-wire"] if arguments.plain_wire else ["--certificates", str(folder)]
    words = ["router", "--listen", endpoint, "--exit-with-parent", *closed]
    words += [word for robot in robots for word in ("--robot", robot.name)]
    words += [word for name in FIELD for word in ("--field", name)] if arguments.fakes else []
    supervisor.start("router", python_command("rolling_panda", words))
    while not _accepts(router_port):
        if supervisor.death() is not None or stopping.wait(_POLL_S):
            return supervisor.death()
        if time.monotonic() - began > STARTUP_S:
            raise InputError(
                f"the router did not listen within {STARTUP_S:.0f} s; its log is {supervisor.log('router')}"
            )
    _progress("router", began)
    for robot in robots:
        named = f" --robot-id {robot.name}" if robot.prefix else ""
        whose = f"The wire of {robot.name}" if robot.prefix else "The robot's wire"
        _say(f"  {whose} is at {endpoint}: rolling-panda status --connect {endpoint} {' '.join(closed)}{named}")

    if arguments.fakes:
        supervisor.start("fakes", python_command("bridge.fakes", [*_fakes_arguments(arguments, endpoint), *closed]))
    token = secrets.token_urlsafe(32)
    write_secret(token_file, token)
    for name, command in commands(robots, arguments, ["--connect", endpoint, *closed], token_file).items():
        supervisor.start(name, command)

    with contextlib.ExitStack() as watched:
        wire = TransportConfig(
            connect=(endpoint,),
            certificates="" if arguments.plain_wire else str(folder),
            plain_wire=arguments.plain_wire,
        )
        ready = [(robot, watched.enter_context(Readiness(wire, robot.name, page))) for robot in robots]
        missing = [f"{robot.prefix}{name}" for robot in robots for name in ("bridge", "controller", "perception")]
        missing.append("server")
        while missing:
            if supervisor.death() is not None or stopping.wait(_POLL_S):
                return supervisor.death()
            for name in sorted(_up(ready) & set(missing)):
                missing.remove(name)
                _progress(name, began)
            if missing and time.monotonic() - began > STARTUP_S:
                logs = ", ".join(str(supervisor.log(name)) for name in missing)
                raise InputError(f"not up within {STARTUP_S:.0f} s: {', '.join(missing)}; see {logs}")

    _say(f"\nSign in once with this link, on this machine:\n\n    {page}/sign-in?token={token}\n")
    _say("Ctrl-C ends everything.")
    while supervisor.death() is None:
        if stopping.wait(_POLL_S):
            return None
    return supervisor.death()


def _up(watched: Sequence[tuple[DemoRobot, Readiness]]) -> set[str]:
    """Names of the processes that are up; the server is once each robot hears of it."""
    heard = [(robot.prefix, seen.up()) for robot, seen in watched]
    own = {prefix + name for prefix, up in heard for name in up - {"server"}}
    return own | ({"server"} if all("server" in up for _, up in heard) else set())


def write_secret(path: Path, text: str) -> None:
    """Write a new file that only this user can read.

    The token is handed over in a file, as a command line or an environment can be read by others on the machine.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(text)


def _fakes_arguments(arguments: argparse.Namespace, endpoint: str) -> list[str]:
    words = ["--config", str(arguments.config.resolve()), "--connect", endpoint, "--seed", str(arguments.seed)]
    return words + ([] if arguments.trace is None else ["--trace", str(arguments.trace.resolve())])


def _progress(name: str, began: float) -> None:
    _say(f"  {name:<10} up  {time.monotonic() - began:5.1f} s")


def _say(text: str) -> None:
    print(text, flush=True)


def choose_router_port(usual: str) -> int:
    """The port of the usual endpoint, where other commands look first; any free one when it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, int(usual.rsplit(":", 1)[1])))
            # Only listening shows a port that another program has bound with the same option.
            probe.listen()
        except OSError:
            with socket.socket() as other:
                other.bind((_HOST, 0))
                return int(other.getsockname()[1])
        return int(probe.getsockname()[1])


def _accepts(port: int) -> bool:
    try:
        with socket.create_connection((_HOST, port), timeout=0.5):
            return True
    except OSError:
        return False
