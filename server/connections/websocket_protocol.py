"""WebSockets with rate limits, and a time limit for reading. A client that breaks them is disconnected.

So no data accumulate for a client that does not read, and no client can use up the server's time.
"""

import asyncio
import time
from collections.abc import Mapping
from typing import Any

from uvicorn._types import ASGIReceiveEvent, ASGISendEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState

from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.token_bucket import TokenBucket
from server.connections.http_protocol import LINGER_S, SiteConfig

_ENDED = "ended"
_POLICY, _TRY_AGAIN = 1008, 1013
#: What a browser that hung for a moment had to keep back may come at once, in seconds of the rate.
_BURST_S = 2.0
#: Number of bytes that are parsed before their messages are counted.
_PIECE = 4096
_TURN_S = 0.05


class LimitedSocket(WebSocketsSansIOProtocol):
    """Uvicorn's WebSocket protocol with rate limits and a time limit for unread data.

    A client that does not answer a ping within `ping_timeout` is disconnected. Pings queue behind earlier data, so a
    client that does not read does not answer. Uvicorn itself would wait for a regular close, which may never come.
    """

    config: SiteConfig

    def __init__(
        self,
        config: SiteConfig,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        """Nothing has been said."""
        super().__init__(config, server_state, app_state, _loop)
        limits = config.limits
        self._messages = TokenBucket(limits.socket_messages_hz, _BURST_S * limits.socket_messages_hz)
        self._bytes = TokenBucket(limits.socket_bytes_hz, _BURST_S * limits.socket_bytes_hz + limits.max_body_bytes)
        self._cut_off = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The request for a WebSocket has come."""
        super().connection_made(transport)
        self._connection = self.config.connections.of(transport)
        self._connection.busy = True

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._connection.rest()

    def data_received(self, data: bytes) -> None:
        """Count what was sent before it is read."""
        for start in range(0, len(data), _PIECE):
            piece = data[start : start + _PIECE]
            if self._cut_off or self.transport.is_closing():
                return
            if not self._bytes.take(time.monotonic(), len(piece)):
                self._cut(_POLICY, reasons.socket_bytes_exceeded(self.config.limits.socket_bytes_hz))
                return
            super().data_received(piece)

    def handle_events(self) -> None:
        """Count messages, pings and all, before they are handed on."""
        now, count = time.monotonic(), len(self.conn.events)
        if not self._messages.take(now, count):
            self._cut(_POLICY, reasons.socket_messages_exceeded(self.config.limits.socket_messages_hz))
        elif self.handshake_complete and not self.close_sent and not self._bucket().take(now, count):
            self._cut(_POLICY, reasons.session_messages_exceeded(self.config.limits.session_messages_hz))
        else:
            super().handle_events()

    async def send(self, message: ASGISendEvent) -> None:
        """Send, or accept or close the WebSocket."""
        if message["type"] != "websocket.accept":
            await super().send(message)
            if self.close_sent:
                # Uvicorn's own waits until all was read, which may be never.
                self._connection.expect(self.close_timeout, self.transport.abort)
            return
        opened = self.config.connections.opened_by(self._state()["session"])
        while not self.disconnected and not opened.take(time.monotonic()):
            await asyncio.sleep(_TURN_S)
        await super().send(message)
        if not self.config.connections.upgrade(self._connection):
            self._cut(_TRY_AGAIN, reasons.too_many_sockets())

    async def receive(self) -> ASGIReceiveEvent:
        """The next message; whoever else waits for the loop has a turn before it."""
        await asyncio.sleep(0)
        return await super().receive()

    def keepalive_timeout(self) -> None:
        """A ping was not answered in time."""
        super().keepalive_timeout()
        self._state()[_ENDED] = reasons.socket_unread()
        self.transport.abort()

    def _state(self) -> dict[str, Any]:
        return self.scope["state"]

    def _bucket(self) -> TokenBucket:
        return self.config.connections.said_by(self._state()["session"])

    def _cut(self, code: int, cause: Reason) -> None:
        self._cut_off = True
        if not self.handshake_complete:
            self.transport.abort()
            return
        self._state()[_ENDED] = cause
        # A close frame has room for 123 bytes.
        reason = reasons.text_of(cause).encode()[:123].decode(errors="ignore")
        self.stop_keepalive()
        if not self.close_sent:
            self.close_sent = True
            self.queue.put_nowait({"type": "websocket.disconnect", "code": code, "reason": reason})
            self.conn.send_close(code, reason)
            self.transport.write(b"".join(self.conn.data_to_send()))
        # Nothing more is read of it, and it is not reset before it has read why.
        self.transport.pause_reading()
        self.read_paused = False
        self.close_timer = self.loop.call_later(LINGER_S, self.transport.abort)


def why_ended(scope: Mapping[str, Any]) -> Reason | None:
    """Reason why the server closed this connection; None if it did not."""
    reason: Reason | None = scope.get("state", {}).get(_ENDED)
    return reason
