"""HTTP with time limits for the TLS handshake, the head and the body of a request, and the reading of the answer."""

import asyncio
import random
import re
from typing import Any

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from rolling_panda import reasons
from server.connections.listener import Connection, Connections, refusal

#: Time for which a refused connection stays open (s): a reset would discard the reason before the client reads it.
LINGER_S = 1.0
#: Paths with an optional body, of one robot or of several: a body that is too long or too late is ignored, and the
#: request proceeds.
OPTIONAL_BODY = re.compile(r"(/robots/[^/]+)?/api/stop")
_EARLIEST = 0.8


class SiteConfig(uvicorn.Config):
    """Uvicorn's configuration, with the limits of the protocols."""

    def __init__(self, app: ASGIApp, connections: Connections, **options: Any) -> None:
        """Serve `app` within the limits of `connections`."""
        self.connections = connections
        self.limits = connections.limits
        super().__init__(app, http=TimedHttp, **options)


class TimedHttp(H11Protocol):
    """Uvicorn's HTTP protocol. A client that sends or reads too slowly is disconnected."""

    config: SiteConfig
    _connection: Connection

    def __init__(
        self,
        config: SiteConfig,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        """Nothing has been asked."""
        super().__init__(config, server_state, app_state, _loop)
        self._awaited = ""
        self._unread: asyncio.TimerHandle | None = None
        self._surplus = 0
        self._ended = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """It is open, and its TLS handshake done; the head of a request has to come in time."""
        super().connection_made(transport)
        self._connection = self.config.connections.of(transport)
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Something was sent."""
        if self._ended:
            return
        if self._is_body_left_over():
            self._surplus += len(data)
            if self._surplus > self.config.limits.max_body_bytes:
                self._linger()
                return
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """An answer is written."""
        super().on_response_complete()
        self._surplus = 0
        self.config.connections.served(self._connection)
        self._watch()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """From here on it is the WebSocket's."""
        self._ended = True
        self._rest()
        self._connection.busy = True
        super().handle_websocket_upgrade(event)

    def pause_writing(self) -> None:
        """The answer is not read as fast as it is written."""
        super().pause_writing()
        self._connection.busy = False
        self._unread = self.loop.call_later(self.config.limits.unread_s, self.transport.abort)

    def resume_writing(self) -> None:
        """It was read."""
        super().resume_writing()
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._rest()

    def _watch(self) -> None:
        """Expect what has to come next."""
        if self._ended:
            return
        if self.transport.is_closing():
            self._connection.busy = False
            self._connection.expect(LINGER_S, self.transport.abort)
            return
        awaited = self._missing()
        self._connection.busy = not awaited and self._unread is None
        if awaited == self._awaited:
            return
        self._awaited = awaited
        if awaited:
            limits = self.config.limits
            most = limits.body_s if awaited == "body" else limits.head_s
            # Many that came at once are not ended at once.
            self._connection.expect(most * random.uniform(_EARLIEST, 1.0), self._late)
        else:
            self._connection.rest()

    def _missing(self) -> str:
        """What has to come next; empty while a request is answered."""
        if self.conn.their_state is h11.SEND_BODY:
            # The application waits for an optional body itself, and not for long.
            is_optional = OPTIONAL_BODY.fullmatch(self.scope["path"]) and not self._is_body_left_over()
            return "" if is_optional else "body"
        if self.conn.their_state is h11.IDLE:
            return "head" if self.conn.trailing_data[0] else "request"
        return ""

    def _is_body_left_over(self) -> bool:
        """The answer was given before all of the body had come, which nobody wants any more."""
        return self.conn.our_state is h11.DONE and self.conn.their_state is h11.SEND_BODY

    def _late(self) -> None:
        if self._awaited == "request":
            self.transport.abort()
            return
        address = self._connection.address
        self.config.connections.note(reasons.request_ended(address, self._awaited), address)
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.write(refusal(408, reasons.request_late(self._awaited)))
        self._linger()

    def _linger(self) -> None:
        self._rest()
        self._ended = True
        self._unset_keepalive_if_required()
        self._connection.busy = False
        if self.cycle is not None and not self.cycle.response_complete:
            # As where the far end has gone: the application is not heard any more.
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.pause_reading()
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self._connection.expect(LINGER_S, self.transport.abort)

    def _rest(self) -> None:
        self._connection.rest()
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None
