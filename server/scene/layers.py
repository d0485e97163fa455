"""What is shown in the 3-D view, each session for itself: everything that is drawn for all hangs below a node here.

Like the scene and its door this uses viser's internals, at an exact version: a node that all views share is shown or
hidden in one of them by a message to that view alone.
"""

from collections.abc import Collection
from typing import get_args

import viser
from viser import _messages as viser_messages

from rolling_panda.messages.page import Layer

#: What a session sees that has not chosen.
USUAL: frozenset[Layer] = frozenset({"plant", "points", "trail", "simulated"})
#: Of these layers all views have the same; the others are drawn for those who want them.
_SHARED: dict[Layer, str] = {"plant": "/plant", "simulated": "/row", "points": "/points", "trail": "/trail"}


class SceneLayers:
    """Who sees which layers."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Put the nodes into the scene that the shared layers hang below."""
        for layer, name in _SHARED.items():
            server.scene.add_frame(name, show_axes=False, visible=layer in USUAL)
        self._chosen: dict[str, frozenset[Layer]] = {}

    def of(self, owner: str) -> frozenset[Layer]:
        """What this session sees."""
        return self._chosen.get(owner, USUAL)

    def choose(self, owner: str, layers: Collection[Layer], clients: list[viser.ClientHandle]) -> None:
        """From now on this session sees these layers and no others."""
        self._chosen[owner] = frozenset(layers)
        for client in clients:
            self.attach(owner, client)

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """Show a view what its owner has chosen."""
        shown = self.of(owner)
        for layer in get_args(Layer):
            name = _SHARED.get(layer)
            if name is not None:
                message = viser_messages.SetSceneNodeVisibilityMessage(name, layer in shown)
                client._websock_connection.queue_message(message)

    def forget(self, owner: str) -> None:
        """This session has signed out."""
        self._chosen.pop(owner, None)
