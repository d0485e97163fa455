"""`rolling-panda status`: which processes are up, for a person or for a container's health check."""

import argparse
import time

from rolling_panda import messages as m
from rolling_panda.cli.demo_readiness import Readiness
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError, TransportError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.transport.settings import DEFAULT_ENDPOINT, PLAIN_ENDPOINT, add_wire_arguments

_POLL_S = 0.02


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the question."""
    parser.add_argument(
        "processes", nargs="*", metavar="PROCESS", help=f"of {', '.join(m.PROCESSES)} (default: all of them)"
    )
    parser.add_argument("--connect", metavar="ENDPOINT", help=f"router (default: {DEFAULT_ENDPOINT})")
    add_wire_arguments(parser)
    parser.add_argument("--robot-id", default=ROBOT_ID, help="robot on the wire (default: %(default)s)")
    parser.add_argument(
        "--wait", type=float, default=2.0, metavar="S", help="how long to listen for them (default: %(default)s s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Listen, print a line for each process; returns 0 when all are up.

    Raises:
        TransportError: The router does not answer.
        InputError: There is no such process.
    """
    unknown = sorted(set(arguments.processes) - set(m.PROCESSES))
    if unknown:
        raise InputError(f"there is no process {', '.join(unknown)}; known are {', '.join(m.PROCESSES)}")
    asked = tuple(arguments.processes) or m.PROCESSES
    deadline = time.monotonic() + arguments.wait
    wire = TransportConfig(
        connect=(arguments.connect or (PLAIN_ENDPOINT if arguments.plain_wire else DEFAULT_ENDPOINT),),
        certificates="" if arguments.certificates is None else str(arguments.certificates),
        plain_wire=arguments.plain_wire,
    )
    try:
        readiness = Readiness(wire, arguments.robot_id, None)
    except TransportError as error:
        raise TransportError(
            f"{error} (the demo prints the whole command when it starts: --connect ENDPOINT --certificates DIR)"
        ) from error
    with readiness:
        while not readiness.up().issuperset(asked) and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        up = readiness.up()
    for name in asked:
        print(f"{name:<10} {'up' if name in up else 'silent'}")
    return 0 if up.issuperset(asked) else 1
