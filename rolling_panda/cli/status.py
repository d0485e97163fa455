"""`rolling-panda status`: which processes are up, for people and for health checks of containers."""

import argparse
import time
import urllib.error
import urllib.request

import msgspec

from rolling_panda import messages as m
from rolling_panda.closing import Closing
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError, TransportError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.topics import BRIDGE, CONTROLLER, HEARTBEAT
from rolling_panda.transport.settings import DEFAULT_ENDPOINT, PLAIN_ENDPOINT, add_wire_arguments
from rolling_panda.transport.zenoh import Onlooker

_POLL_S = 0.02
_NO_PROXY = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
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
    processes = tuple(arguments.processes) or m.PROCESSES
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
        while not readiness.up().issuperset(processes) and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        up = readiness.up()
    for name in processes:
        print(f"{name:<10} {'up' if name in up else 'silent'}")
    return 0 if up.issuperset(processes) else 1


class Readiness(Closing):
    """Which processes are up, as seen on the wire. Use as a context manager, or call `close`.

    A process counts as up once its loop has sent a message, which is later than its connection.
    """

    def __init__(self, wire: TransportConfig, robot_id: str, page: str | None) -> None:
        """Connect to the router.

        `page` is the address of the page, which has to answer before the server counts as up; None skips that check.

        Raises:
            TransportError: The router does not answer.
        """
        self._page = page
        self._up: set[str] = set()
        self._onlooker = Onlooker(msgspec.structs.replace(wire, connect_timeout_s=3.0), robot_id)
        self._onlooker.subscribe(BRIDGE, lambda message, at: self._up.add("bridge"))
        self._onlooker.subscribe(CONTROLLER, lambda message, at: self._up.add("controller"))
        self._onlooker.subscribe(HEARTBEAT, self._on_heartbeat)

    def up(self) -> frozenset[str]:
        """Processes that are up now."""
        return frozenset(name for name in tuple(self._up) if name != "server" or self._page_answers())

    def close(self) -> None:
        """Stop watching."""
        self._onlooker.close()

    def _on_heartbeat(self, message: m.Heartbeat, at: float) -> None:
        self._up.add(message.process)

    def _page_answers(self) -> bool:
        if self._page is None:
            return True
        try:
            with _NO_PROXY.open(f"{self._page}/api/health", timeout=1.0) as reply:
                return bool(reply.status == 200)
        except (urllib.error.URLError, OSError):
            return False
