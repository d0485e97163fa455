"""Start and end of a process: arguments, configuration, transport, signals, and errors as one line."""

import argparse
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from rolling_panda import __version__, timeouts
from rolling_panda import messages as m
from rolling_panda.config import TransportConfig, load_section
from rolling_panda.errors import ConfigError, RollingPandaError
from rolling_panda.resources import resource
from rolling_panda.runtime.scheduling import Priority, freeze_heap, set_priority
from rolling_panda.runtime.state_folder import open_state_folder, usual_state_folder
from rolling_panda.topics import ROBOT_ID as ROBOT_ID
from rolling_panda.transport.settings import add_wire_arguments
from rolling_panda.transport.zenoh import Transport

#: Time limit for an orderly end after the parent has ended (s).
_GRACE_S = 2.0
_PRIORITY: dict[m.Process, Priority] = {
    "bridge": "control",
    "controller": "control",
    "server": "interface",
    "perception": "perception",
}


@dataclass(frozen=True)
class ProcessContext:
    """The context that a process runs in.

    Attributes:
        arguments: Parsed command line.
        config_path: The TOML file.
        transport: Open session on the robot's wire.
        stopping: Set when the process has to end.
    """

    arguments: argparse.Namespace
    config_path: Path
    transport: Transport
    stopping: threading.Event

    @property
    def wire(self) -> TransportConfig:
        """Settings of the robot's wire, from configuration and command line."""
        return wire_config(self.arguments)

    @property
    def state_folder(self) -> Path:
        """Folder of the robot's state that survives a restart; created on first use.

        Raises:
            InputError: It cannot be created.
        """
        return state_folder(self.arguments)


def state_folder(arguments: argparse.Namespace) -> Path:
    """The state folder of a command line; created where it is missing.

    Raises:
        InputError: It cannot be created.
    """
    return open_state_folder(arguments.state or usual_state_folder(arguments.robot_id))


def run_process(
    process: m.Process,
    description: str,
    run: Callable[[ProcessContext], None],
    add_arguments: Callable[[argparse.ArgumentParser], None] | None = None,
    argv: Sequence[str] | None = None,
    check: Callable[[argparse.Namespace], object] = lambda arguments: None,
) -> int:
    """Parse, configure, connect, run until SIGINT or SIGTERM, close. Returns the exit code.

    Args:
        process: Name of the process.
        description: For `--help`.
        run: Does the work; returns when `context.stopping` is set.
        add_arguments: Adds the process's own options.
        argv: Command line without the program's name; None takes `sys.argv`.
        check: Raises where the command line or the configuration is wrong. It runs before the connection, whose
            failure would hide such an error.
    """
    parser = argparse.ArgumentParser(prog=f"rolling-panda {process}", description=description)
    add_common_arguments(parser)
    if add_arguments is not None:
        add_arguments(parser)
    arguments = parser.parse_args(argv)
    stopping = stop_on_signals()
    if arguments.exit_with_parent:
        end_with_parent(stopping)
    try:
        wire = wire_config(arguments)
        check(arguments)
        timeouts.check(arguments.config)
        set_priority(_PRIORITY[process])
        freeze_heap()
        with Transport(wire, process, arguments.robot_id) as transport:
            run(ProcessContext(arguments, arguments.config, transport, stopping))
    except RollingPandaError as error:
        print(f"rolling-panda {process}: {error}", file=sys.stderr)
        return 1
    return 0


def wire_config(arguments: argparse.Namespace) -> TransportConfig:
    """Section `[transport]`, overridden by the command line.

    Raises:
        ConfigError: The section is wrong.
    """
    config = load_section(arguments.config, "transport", TransportConfig)
    if config.plain_wire:
        raise ConfigError(
            f"{arguments.config}: [transport] plain_wire is no key of a file; give --plain-wire each time"
        )
    if arguments.plain_wire:
        connect = tuple(endpoint.replace("tls/", "tcp/", 1) for endpoint in config.connect)
        config = msgspec.structs.replace(config, plain_wire=True, connect=connect)
    if arguments.connect is not None:
        config = msgspec.structs.replace(config, connect=(arguments.connect,))
    if arguments.certificates is not None:
        config = msgspec.structs.replace(config, certificates=str(arguments.certificates))
    return config


def add_common_arguments(parser: argparse.ArgumentParser) -> None:
    """Options that every process takes."""
    default = resource("assets/config/sim.toml")
    parser.add_argument("--config", type=Path, default=default, help="TOML configuration (default: the simulation's)")
    parser.add_argument("--robot-id", default=ROBOT_ID, help="robot on the wire (default: %(default)s)")
    parser.add_argument("--connect", metavar="ENDPOINT", help="router, tls/HOST:PORT (default: the configuration's)")
    add_wire_arguments(parser)
    state = usual_state_folder("ROBOT_ID")
    parser.add_argument(
        "--state", type=Path, metavar="DIR", help=f"folder for what survives a restart (default: {state})"
    )
    parser.add_argument("--exit-with-parent", action="store_true", help="end when standard input closes")
    parser.add_argument("--version", action="version", version=f"rolling-panda {__version__}")


def stop_on_signals() -> threading.Event:
    """An event that SIGINT and SIGTERM set.

    Another thread sets it, since a handler interrupts the main thread. Where that is in `Event.wait`, setting the same
    event in the handler would deadlock.
    """
    stopping = threading.Event()
    caught: queue.SimpleQueue[int] = queue.SimpleQueue()

    def watch() -> None:
        caught.get()
        stopping.set()

    threading.Thread(target=watch, name="signal-watch", daemon=True).start()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: caught.put(number))
    return stopping


def end_with_parent(stopping: threading.Event) -> None:
    """End this process when its standard input closes, as it does when the parent ends or is killed."""

    def watch() -> None:
        while os.read(0, 4096):
            pass
        stopping.set()
        # A hung loop must not outlive the parent.
        threading.Event().wait(_GRACE_S)
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
