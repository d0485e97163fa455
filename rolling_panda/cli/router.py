"""`rolling-panda router`: the Zenoh router that the processes connect to."""

import argparse

from rolling_panda.config import TransportConfig
from rolling_panda.runtime.process import end_with_parent, stop_on_signals
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.topics import ROBOT_ID
from rolling_panda.transport.settings import DEFAULT_ENDPOINT, PLAIN_ENDPOINT, PLAIN_WARNING, add_wire_arguments
from rolling_panda.transport.zenoh import Router


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the router."""
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        action="append",
        help=f"where to listen, tls/HOST:PORT; may be given several times (default: {DEFAULT_ENDPOINT})",
    )
    add_wire_arguments(parser)
    parser.add_argument(
        "--robot",
        metavar="ID",
        action="append",
        help=f"robot that the certificates are for; may be given several times (default: {ROBOT_ID})",
    )
    parser.add_argument(
        "--field",
        metavar="KEY",
        action="append",
        default=[],
        help="keys of the devices behind the bridge's drivers that this router carries too; may be given several times",
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
    endpoints = tuple(arguments.listen or (PLAIN_ENDPOINT if arguments.plain_wire else DEFAULT_ENDPOINT,))
    set_priority("control")
    folder = "" if arguments.certificates is None else str(arguments.certificates)
    router = Router(
        TransportConfig(
            mode="router",
            listen=endpoints,
            connect=(),
            certificates=folder,
            robots=tuple(arguments.robot or (ROBOT_ID,)),
            field=tuple(arguments.field),
            plain_wire=arguments.plain_wire,
        )
    )
    try:
        print(f"router listening on {', '.join(endpoints)}", flush=True)
        if arguments.plain_wire:
            print(PLAIN_WARNING, flush=True)
        stopping.wait()
    finally:
        router.close()
    return 0
