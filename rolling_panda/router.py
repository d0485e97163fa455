"""`rolling-panda router`: the place on the network where the processes meet."""

import argparse
from pathlib import Path

from rolling_panda.config import TransportConfig
from rolling_panda.priority import take_priority
from rolling_panda.process import end_with_parent, stop_on_signals
from rolling_panda.topics import ROBOT_ID
from rolling_panda.transport import Router

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the router."""
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        action="append",
        help=f"where to listen, tcp/HOST:PORT; may be given several times (default: {DEFAULT_ENDPOINT})",
    )
    parser.add_argument(
        "--certificates",
        type=Path,
        metavar="DIR",
        help="mutual TLS and access control, listening at tls/HOST:PORT; see `rolling-panda certificates --help`",
    )
    parser.add_argument(
        "--robot",
        metavar="ID",
        action="append",
        help=f"robot that the certificates are for; may be given several times (default: {ROBOT_ID})",
    )
    parser.add_argument("--exit-with-parent", action="store_true", help="end when standard input closes")


def run(arguments: argparse.Namespace) -> int:
    """Route until SIGINT or SIGTERM.

    Raises:
        TransportError: An endpoint is taken or wrong.
    """
    stopping = stop_on_signals()
    if arguments.exit_with_parent:
        end_with_parent(stopping)
    endpoints = tuple(arguments.listen or (DEFAULT_ENDPOINT,))
    take_priority("control")
    folder = "" if arguments.certificates is None else str(arguments.certificates)
    robots = tuple(arguments.robot or (ROBOT_ID,))
    router = Router(TransportConfig(mode="router", listen=endpoints, connect=(), certificates=folder, robots=robots))
    try:
        print(f"router listening on {', '.join(endpoints)}", flush=True)
        stopping.wait()
    finally:
        router.close()
    return 0
