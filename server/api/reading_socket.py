"""WebSockets whose far end has to read: one that does not is dropped, so that nothing is kept for it."""

from collections.abc import Mapping
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_UNREAD = "unread"


class ReadingSocket(WebSocketsSansIOProtocol):
    """Uvicorn's, but a far end that does not answer a ping within `ping_timeout` is cut off.

    Pings stand behind what was sent before them, so whoever does not read does not answer. Uvicorn itself would then
    close politely, after all that it has written is read, which may be never.
    """

    def keepalive_timeout(self) -> None:
        """A ping was not answered in time."""
        super().keepalive_timeout()
        self.scope["state"][_UNREAD] = True
        self.transport.abort()


def was_unread(scope: Mapping[str, Any]) -> bool:
    """Whether this connection was dropped since its far end did not read."""
    return bool(scope.get("state", {}).get(_UNREAD))
