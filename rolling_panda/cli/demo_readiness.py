"""Which processes are up: seen from outside, by what they say on the wire and by the page answering."""

import urllib.error
import urllib.request
from types import TracebackType
from typing import Self

import msgspec

from rolling_panda import messages as m
from rolling_panda.config import TransportConfig
from rolling_panda.topics import BRIDGE, CONTROLLER, HEARTBEAT
from rolling_panda.transport.zenoh import Onlooker

_NO_PROXY = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class Readiness:
    """Watches the wire read-only while the program starts. Use as a context manager, or call `close`.

    A process counts as up once its loop has spoken, which is later than being connected.
    """

    def __init__(self, wire: TransportConfig, robot_id: str, page: str | None) -> None:
        """Connect to the router.

        `page` is the address that the server will answer at; without it, the server's word on the wire is enough.

        Raises:
            TransportError: The router does not answer.
        """
        self._page = page
        self._heard: set[str] = set()
        self._onlooker = Onlooker(msgspec.structs.replace(wire, connect_timeout_s=3.0), robot_id)
        self._onlooker.subscribe(BRIDGE, lambda message, at: self._heard.add("bridge"))
        self._onlooker.subscribe(CONTROLLER, lambda message, at: self._heard.add("controller"))
        self._onlooker.subscribe(HEARTBEAT, self._on_heartbeat)

    def up(self) -> frozenset[str]:
        """Processes that are up now."""
        return frozenset(name for name in tuple(self._heard) if name != "server" or self._page_answers())

    def close(self) -> None:
        """Stop watching."""
        self._onlooker.close()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def _on_heartbeat(self, message: m.Heartbeat, at: float) -> None:
        self._heard.add(message.process)

    def _page_answers(self) -> bool:
        if self._page is None:
            return True
        try:
            with _NO_PROXY.open(f"{self._page}/api/health", timeout=1.0) as reply:
                return bool(reply.status == 200)
        except (urllib.error.URLError, OSError):
            return False
