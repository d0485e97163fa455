"""`rolling-panda status`: which processes are up, for a person or for a container's health check."""

import argparse
import time
from pathlib import Path

from rolling_panda import messages as m
from rolling_panda.demo_readiness import Readiness
from rolling_panda.errors import InputError, TransportError
from rolling_panda.process import ROBOT_ID
from rolling_panda.router import DEFAULT_ENDPOINT

_POLL_S = 0.02


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the question."""
    parser.add_argument(
        "processes", nargs="*", metavar="PROCESS", help=f"of {', '.join(m.PROCESSES)} (default: all of them)"
    )
    parser.add_argument("--connect", metavar="ENDPOINT", default=DEFAULT_ENDPOINT, help="router (default: %(default)s)")
    parser.add_argument(
        "--certificates", type=Path, metavar="DIR", help="with onlooker.pem, for a router at tls/HOST:PORT"
    )
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
    try:
        readiness = Readiness(arguments.connect, arguments.robot_id, None, arguments.certificates)
    except TransportError as error:
        raise TransportError(f"{error} Give its endpoint with --connect; the demo prints it when it starts.") from error
    with readiness:
        while not readiness.up().issuperset(asked) and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        up = readiness.up()
    for name in asked:
        print(f"{name:<10} {'up' if name in up else 'silent'}")
    return 0 if up.issuperset(asked) else 1
