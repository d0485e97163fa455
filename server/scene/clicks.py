"""Clicks anywhere into the 3-D view, as lines of sight, for sessions that place points by hand."""

from collections.abc import Callable

import viser

from rolling_panda import messages as m

Clicked = Callable[[viser.SceneClickEvent], None]


class SceneClicks:
    """Listens to the views of those who place points, and to nobody else's."""

    def __init__(self, on_sightline: Callable[[str, m.Vector3, m.Vector3], object]) -> None:
        """`on_sightline(owner, origin, direction)` is called on viser's thread, in odom, for each click."""
        self._on_sightline = on_sightline
        self._listening: dict[str, dict[int, tuple[viser.ClientHandle, Clicked]]] = {}

    def listen(self, owner: str, clients: list[viser.ClientHandle]) -> None:
        """Take the clicks of `owner` from now on."""
        self._listening.setdefault(owner, {})
        for client in clients:
            self.attach(owner, client)

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """Listen to a view that has just opened, if its owner places points."""
        views = self._listening.get(owner)
        if views is None or client.client_id in views:
            return

        def clicked(event: viser.SceneClickEvent) -> None:
            self._on_sightline(owner, event.ray_origin, event.ray_direction)

        client.scene.on_click()(clicked)
        views[client.client_id] = client, clicked

    def detach(self, client_id: int) -> None:
        """A view has closed."""
        for views in self._listening.values():
            views.pop(client_id, None)

    def end(self, owner: str) -> None:
        """Take no more clicks of `owner`."""
        for client, clicked in self._listening.pop(owner, {}).values():
            client.scene.remove_click_callback(clicked)
