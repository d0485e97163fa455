"""Limits of open connections: in total, for each address, and for WebSockets.

A connection counts from its acceptance, before any TLS handshake, until its socket is closed. At the limit a new
connection replaces the one that has been idle longest, so that idle connections cannot keep others out. Requests in
progress and open WebSockets stay.
"""

import asyncio
import socket
from collections import Counter, OrderedDict
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary

import msgspec

from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.token_bucket import TokenBucket
from server.config import ServerConfig

#: Fraction of the connections that may be WebSockets; the rest is for requests such as the stop.
_SOCKETS_SHARE = 2 / 3
#: Accepted in one turn of the loop; a stop that was accepted before is served between the turns.
_A_TURN = 16
#: Burst of a session over all of its WebSockets, in seconds of its rate.
_BURST_S = 2.0
#: How many WebSockets a session may open a second and at once: a new 3-D view is sent all that is in it.
_OPEN_HZ, _OPEN_AT_ONCE = 10.0, 20.0


class Connection:
    """One open connection.

    Attributes:
        peer: Remote end: address and port first.
        busy: Whether a request is in progress, or the connection is an open WebSocket.
        served: Whether a request was answered.
        is_websocket: Whether it is a WebSocket.
        end: Closes it at once.
    """

    def __init__(self, peer: tuple[Any, ...], end: Callable[[], object]) -> None:
        """Nothing has been said yet."""
        self.peer, self.end = peer, end
        self.busy = self.served = self.is_websocket = False
        self._timer: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        """Of the far end, without the port."""
        return str(self.peer[0]) if self.peer else ""

    def expect(self, within_s: float, otherwise: Callable[[], object]) -> None:
        """Call `otherwise` after so long, in place of what was expected before."""
        self.rest()
        self._timer = asyncio.get_running_loop().call_later(within_s, otherwise)

    def rest(self) -> None:
        """Nothing is expected any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class Connections:
    """All open connections, the one served longest ago first. Belongs to the server's event loop."""

    def __init__(self, limits: ServerConfig, note: Callable[[Reason, str], object] = lambda reason, by: None) -> None:
        """Start without connections. `note(reason, by)` reports refused and ended connections with their client."""
        self.limits, self.note = limits, note
        self._open: OrderedDict[tuple[Any, ...], Connection] = OrderedDict()
        self._of_address: Counter[str] = Counter()
        self._said: WeakKeyDictionary[object, TokenBucket] = WeakKeyDictionary()
        self._opened: WeakKeyDictionary[object, TokenBucket] = WeakKeyDictionary()

    def __len__(self) -> int:
        """How many are open."""
        return len(self._open)

    def admit(self, new: Connection) -> bool:
        """Count a connection that was accepted; False, and it does not count, where there is no room to be made."""
        crowded = self._of_address[new.address] >= self.limits.connections_per_address
        if crowded or len(self._open) >= self.limits.connections:
            # A client that has had an answer is less likely to be part of a flood of idle connections.
            address = new.address if crowded else ""
            idle = self._first_idle(address, served=False) or self._first_idle(address, served=True)
            if idle is None:
                one, of_all = reasons.connection_refused(new.address, new.address), reasons.connection_refused_of_all
                self.note(one if crowded else of_all(new.address), new.address)
                return False
            one = reasons.connection_replaced(new.address)
            self.note(one if crowded else reasons.connection_replaced_of_all(), new.address)
            self.gone(idle)
            idle.end()
        if new.peer in self._open:
            # The port is reused before the server has noticed the end of the old connection.
            self.gone(self._open[new.peer])
        self._open[new.peer] = new
        self._of_address[new.address] += 1
        return True

    def _first_idle(self, address: str, served: bool) -> Connection | None:
        every = (each for each in self._open.values() if not each.busy and each.served is served)
        return next((each for each in every if not address or each.address == address), None)

    def of(self, transport: asyncio.BaseTransport) -> Connection:
        """The connection under this transport, which ends it from now on; one that does not count if it was ended."""
        peer = transport.get_extra_info("peername")
        found = self._open.get(peer)
        if not isinstance(transport, asyncio.WriteTransport) or found is None:
            return Connection(peer or (), transport.close)
        found.end = transport.abort
        return found

    def served(self, connection: Connection) -> None:
        """It has had an answer: others go before it when room is made."""
        connection.served = True
        if self._open.get(connection.peer) is connection:
            self._open.move_to_end(connection.peer)

    def upgrade(self, connection: Connection) -> bool:
        """It is to be a WebSocket; False where there are too many of them."""
        sockets = [each for each in self._open.values() if each.is_websocket]
        theirs = sum(each.address == connection.address for each in sockets)
        connection.is_websocket = (
            theirs < _SOCKETS_SHARE * self.limits.connections_per_address
            and len(sockets) < _SOCKETS_SHARE * self.limits.connections
        )
        return connection.is_websocket

    def said_by(self, session: object) -> TokenBucket:
        """Rate limit of a session over all of its WebSockets."""
        rate = self.limits.session_messages_hz
        return self._said.setdefault(session, TokenBucket(rate, _BURST_S * rate))

    def opened_by(self, session: object) -> TokenBucket:
        """WebSockets that this session may open."""
        return self._opened.setdefault(session, TokenBucket(_OPEN_HZ, _OPEN_AT_ONCE))

    def gone(self, connection: Connection) -> None:
        """It is closed; safe to call twice."""
        connection.rest()
        if self._open.get(connection.peer) is connection:
            del self._open[connection.peer]
            self._of_address[connection.address] -= 1
            if not self._of_address[connection.address]:
                del self._of_address[connection.address]


class Listener(socket.socket):
    """A listening socket that counts its accepted connections, after `count` was called."""

    _connections: Connections | None = None
    _speaks_tls = False
    _accepted = 0

    def count(self, connections: Connections, speaks_tls: bool) -> None:
        """Count connections from now on."""
        self._connections, self._speaks_tls = connections, speaks_tls

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection that there is room for."""
        while True:
            if self._connections is None:
                return super().accept()
            self._accepted = (self._accepted + 1) % (_A_TURN + 1)
            if self._accepted == 0:
                # For asyncio this means "no more for now"; it retries in its next iteration.
                raise BlockingIOError
            plain, peer = super().accept()
            accepted = _Counted(plain.family, plain.type, plain.proto, plain.detach())
            accepted.setblocking(False)
            if accepted.admitted(self._connections, peer):
                return accepted, peer
            if not self._speaks_tls:
                with suppress(OSError):
                    accepted.send(refusal(503, reasons.too_many_connections()))
            accepted.close()


def listen(host: str, port: int) -> Listener:
    """The page's socket, bound before anything else starts.

    Raises:
        InputError: The port is taken or may not be used.
    """
    listener = Listener()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    # Connections inherit it. Otherwise the second part of a response waits for the acknowledgement of the first, which
    # takes 40 ms; asyncio sets it only on sockets that name their protocol.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        listener.bind((host, port))
        # Another program may have bound the port with the same option, which only listening detects.
        listener.listen(64)
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot listen on {host}:{port}: {reason}. Choose another with --port.") from error
    return listener


class _Counted(socket.socket):
    """The socket of a counted connection."""

    _leave: Callable[[], None] | None = None

    def admitted(self, connections: Connections, peer: tuple[Any, ...]) -> bool:
        """Whether there is room for it."""
        connection = Connection(peer, self._hang_up)
        if not connections.admit(connection):
            return False
        self._leave = lambda: connections.gone(connection)
        # Until a protocol has it, as during a TLS handshake.
        connection.expect(connections.limits.head_s, self._hang_up)
        return True

    def _hang_up(self) -> None:
        with suppress(OSError):
            self.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close it; it does not count any more."""
        if self._leave is not None:
            self._leave()
            self._leave = None
        super().close()


def refusal(status: int, reason: Reason) -> bytes:
    """A whole answer of HTTP/1.1 where no request was read; the connection ends after it."""
    words = {408: "Request Timeout", 503: "Service Unavailable"}[status]
    body = msgspec.json.encode({"ok": False, "reason": reasons.text_of(reason), "code": reason.code})
    head = (
        f"HTTP/1.1 {status} {words}\r\ncontent-type: application/json\r\ncontent-length: {len(body)}\r\n"
        f"retry-after: 1\r\nconnection: close\r\n\r\n"
    )
    return head.encode() + body
