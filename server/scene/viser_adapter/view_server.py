"""A viser server that serves the views of signed-in sessions alone.

- Viser accepts anybody who finds its port; here only the proxy's connections pass.
- A race between viser's threads is fixed.
- Viewers are sent fewer updates where many views are open.
"""

import asyncio
import contextlib
import io
from collections.abc import AsyncGenerator, Callable, Sequence
from dataclasses import dataclass
from typing import Any

import viser

from server.scene.viser_adapter import contract

_PATCHED = "_event_thread_patched"
#: Number of views from which viewers' views are updated less often, and the time between two updates (s).
_FEW_VIEWS, _VIEWER_PAUSE_S = 8, 0.2


@dataclass(frozen=True)
class _Owner:
    """The session that owns a connection, whether it may operate the robot, and the pixels of a CSS pixel there."""

    session_id: str
    may_operate: bool
    pixel_ratio: float


class ViewServer:
    """Viser on a loopback port of its own, and the session that owns each of its views.

    The proxy announces the local port of each connection before it connects. A connection from any other port is closed
    before viser reads a byte of it.

    Attributes:
        viser: For viser's public interface: the scene and the views.
        port: Of viser on the loopback address.
    """

    def __init__(self, on_refusal: Callable[[], object]) -> None:
        """Start viser; `on_refusal` is called on viser's thread when a connection was refused.

        Raises:
            ViserChangedError: This version of viser is not as the server needs it.
        """
        patch_event_thread()
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        contract.check(self.viser)
        self.port = int(self.viser.get_port())
        self._server = self.viser._websock_server
        self._on_refusal = on_refusal
        self._expected: dict[int, _Owner] = {}
        self._owners: dict[int, _Owner] = {}
        self._connections: dict[int, Any] = {}
        # A request of this type would publish the view through a public tunnel.
        for kind in (contract.messages.ShareUrlRequest, contract.messages.ShareUrlDisconnect):
            self._server.unregister_handler(kind)
        self._server.on_client_connect(self._check)
        self._server.on_client_disconnect(self._forget_client)
        limit_frame_rate(
            self._server._broadcast_buffer,
            lambda client_id: update_pause_s(len(self.viser.get_clients()), self._may_operate(client_id)),
        )

    def expect(self, port: int, owner: str, may_operate: bool, pixel_ratio: float = 1.0) -> None:
        """Announce a connection from this local port of the session `owner`, with the pixels of a CSS pixel there."""
        self._expected[port] = _Owner(owner, may_operate, pixel_ratio)

    def forget(self, port: int) -> None:
        """That connection has ended."""
        self._expected.pop(port, None)

    def owner(self, client_id: int) -> str | None:
        """The session that owns a viser client; None for a refused one."""
        owner = self._owners.get(client_id)
        return None if owner is None else owner.session_id

    def pixel_ratio(self, client_id: int) -> float:
        """Pixels of the view for each CSS pixel."""
        owner = self._owners.get(client_id)
        return 1.0 if owner is None else owner.pixel_ratio

    def set_visible(self, client_id: int, name: str, visible: bool) -> None:
        """Show or hide in one view a node that all views share."""
        connection = self._connections.get(client_id)
        if connection is not None:
            connection.queue_message(contract.messages.SetSceneNodeVisibilityMessage(name, visible))

    def close(self) -> None:
        """Stop viser."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser.stop()

    def _may_operate(self, client_id: int) -> bool:
        owner = self._owners.get(client_id)
        return owner is not None and owner.may_operate

    async def _check(self, connection: Any) -> None:
        client_id = int(connection.client_id)
        socket = self._server._live_connections[connection.client_id]
        owner = self._expected.get(socket.remote_address[1])
        if owner is None:
            self._on_refusal()
            await socket.close(1008, "connect through the page")
        else:
            self._connections[client_id], self._owners[client_id] = connection, owner

    async def _forget_client(self, connection: Any) -> None:
        self._connections.pop(int(connection.client_id), None)
        self._owners.pop(int(connection.client_id), None)


def adopt_pose(handle: Any, position: Sequence[float], wxyz: Sequence[float]) -> None:
    """The browser has dragged this node to here: viser draws it elsewhere only where that differs from this."""
    handle.position[:], handle.wxyz[:] = position, wxyz


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
    kind: Any = contract.buffers.AsyncMessageBuffer
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


def limit_frame_rate(buffer: Any, pause_s: Callable[[int], float]) -> None:
    """Let each view of a buffer wait `pause_s(client_id)` seconds after an update; the initial scene comes without.

    Each view's update is packed and sent separately, so dozens of views would delay the one that moves the robot.
    Nothing is queued meanwhile: after the wait a view is sent the newest value of everything.
    """
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
