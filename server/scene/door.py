"""Which connection of the 3-D view belongs to whom: viser itself accepts anybody who finds its port.

The proxy announces the local port of each connection before it connects. A connection from any other port is closed
before viser reads a word of it. This and the scene are the places that use viser's internals, at an exact version.
"""

from collections.abc import Callable

import viser
from viser import _messages as viser_messages
from viser.infra import WebsockClientConnection


class SceneDoor:
    """Lets in the connections of the proxy alone, and knows whose they are."""

    def __init__(self, server: viser.ViserServer, on_stranger: Callable[[], object]) -> None:
        """Guard `server`; `on_stranger` is called on viser's thread when a connection was refused."""
        self._server = server._websock_server
        self._on_stranger = on_stranger
        self._expected: dict[int, tuple[str, bool]] = {}
        self._owners: dict[int, tuple[str, bool]] = {}
        # A request of this type would publish the view through a public tunnel.
        for kind in (viser_messages.ShareUrlRequest, viser_messages.ShareUrlDisconnect):
            self._server.unregister_handler(kind)
        self._server.on_client_connect(self._check)

    def expect(self, port: int, owner: str, may_operate: bool) -> None:
        """The connection from this local port, about to be made, belongs to `owner`."""
        self._expected[port] = owner, may_operate

    def forget(self, port: int) -> None:
        """That connection has ended."""
        self._expected.pop(port, None)

    def owner(self, client_id: int) -> str | None:
        """Whose connection a viser client is; None for strangers."""
        return self._owners.get(client_id, (None, False))[0]

    def looks_on(self, client_id: int) -> bool:
        """Whether who has this connection may not operate."""
        return not self._owners.get(client_id, ("", False))[1]

    async def _check(self, connection: WebsockClientConnection) -> None:
        client_id = int(connection.client_id)
        socket = self._server._live_connections[connection.client_id]
        owner = self._expected.get(socket.remote_address[1])
        if owner is None:
            self._on_stranger()
            await socket.close(1008, "connect through the page")
        else:
            self._owners[client_id] = owner
