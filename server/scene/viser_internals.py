"""Everything that uses viser's internals, at the exact version that pyproject.toml names.

- `ViewConnections`: viser accepts anybody who finds its port; here only the proxy's connections pass.
- `patch_event_thread`: a fix of a race between viser's threads.
- `limit_frame_rate`: viewers are sent fewer updates where many views are open.
- `set_node_visibility`: shows or hides a shared node in one view alone.
- `client_page`: the page of viser's client.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from pathlib import Path
from typing import Any

import viser
from viser import _messages as viser_messages
from viser.infra import WebsockClientConnection
from viser.infra import _async_message_buffer as viser_buffer

VISER_VERSION = viser.__version__
_PATCHED = "_event_thread_patched"
#: Number of views from which viewers' views are updated less often, and the time between two updates (s).
_FEW_VIEWS, _VIEWER_PAUSE_S = 8, 0.2


def client_page() -> bytes:
    """The client's page: one self-contained HTML file."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()


def set_node_visibility(client: viser.ClientHandle, name: str, visible: bool) -> None:
    """Show or hide in one view a node that all views share."""
    message = viser_messages.SetSceneNodeVisibilityMessage(name, visible)
    client._websock_connection.queue_message(message)


class ViewConnections:
    """Accepts the proxy's connections alone, and knows which session owns each.

    The proxy announces the local port of each connection before it connects. A connection from any other port is closed
    before viser reads a byte of it.
    """

    def __init__(self, server: viser.ViserServer, on_refusal: Callable[[], object]) -> None:
        """Guard `server`; `on_refusal` is called on viser's thread when a connection was refused."""
        self._server = server._websock_server
        self._on_refusal = on_refusal
        self._expected: dict[int, tuple[str, bool]] = {}
        self._owners: dict[int, tuple[str, bool]] = {}
        # A request of this type would publish the view through a public tunnel.
        for kind in (viser_messages.ShareUrlRequest, viser_messages.ShareUrlDisconnect):
            self._server.unregister_handler(kind)
        self._server.on_client_connect(self._check)

    def expect(self, port: int, owner: str, may_operate: bool) -> None:
        """Announce a connection from this local port that belongs to `owner`."""
        self._expected[port] = owner, may_operate

    def forget(self, port: int) -> None:
        """That connection has ended."""
        self._expected.pop(port, None)

    def owner(self, client_id: int) -> str | None:
        """The session that owns a viser client; None for a refused one."""
        return self._owners.get(client_id, (None, False))[0]

    def may_operate(self, client_id: int) -> bool:
        """Whether the session that owns a viser client may operate the robot."""
        return self._owners.get(client_id, ("", False))[1]

    async def _check(self, connection: WebsockClientConnection) -> None:
        client_id = int(connection.client_id)
        socket = self._server._live_connections[connection.client_id]
        owner = self._expected.get(socket.remote_address[1])
        if owner is None:
            self._on_refusal()
            await socket.close(1008, "connect through the page")
        else:
            self._owners[client_id] = owner


class SameThreadEvent(asyncio.Event):
    """An event that only its own loop's thread sets; a call of `set` from another thread does nothing."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Not set."""
        super().__init__()
        self._own = loop

    def set(self) -> None:
        """Wake the waiting tasks, when called on the loop."""
        try:
            running = asyncio.get_running_loop()
        except RuntimeError:
            return
        if running is self._own:
            super().set()


def patch_event_thread() -> None:
    """Give every message buffer that viser makes from now on a `SameThreadEvent`; safe to call twice.

    Viser 1.1.1 sets an `asyncio.Event` from the thread that changed the scene, and again on its own thread just after.
    The first call iterates over the waiting tasks while they come and go. With dozens of views it fails in time ("deque
    mutated during iteration") and ends the server. The second call is enough.
    """
    kind: Any = viser_buffer.AsyncMessageBuffer
    if getattr(kind, _PATCHED, False):
        return
    original = kind.__init__

    def patched(self: Any, event_loop: asyncio.AbstractEventLoop, *rest: Any, **more: Any) -> None:
        original(self, event_loop, *rest, **more)
        self.message_event = SameThreadEvent(event_loop)

    kind.__init__ = patched
    setattr(kind, _PATCHED, True)


def update_pause_s(views: int, may_operate: bool) -> float:
    """How long a view waits after an update (s).

    Args:
        views: Number of open views.
        may_operate: Whether this view's session may operate the robot; then it never waits.
    """
    return 0.0 if may_operate or views <= _FEW_VIEWS else _VIEWER_PAUSE_S


def limit_frame_rate(server: viser.ViserServer, pause_s: Callable[[int], float]) -> None:
    """Let each view wait `pause_s(client_id)` seconds after an update; the initial scene comes without a wait.

    Each view's update is packed and sent separately, so dozens of views would delay the one that moves the robot.
    Nothing is queued meanwhile: after the wait a view is sent the newest value of everything.
    """
    buffer = server._websock_server._broadcast_buffer
    original = buffer.window_generator

    async def limited(client_id: int, **more: Any) -> AsyncGenerator[Sequence[Any], None]:
        windows = original(client_id, **more)
        try:
            async for window in windows:
                yield window
                # A full window is part of the initial scene.
                if len(window) < buffer.max_window_size and (seconds := pause_s(client_id)):
                    await asyncio.sleep(seconds)
        finally:
            await windows.aclose()

    buffer.window_generator = limited
