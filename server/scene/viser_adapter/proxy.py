"""The 3-D view on the page's own origin: its client page, and its WebSocket through a filter.

Viser trusts its client, which may click disabled buttons, set sliders beyond their ends, move gizmos through their
limits and open public tunnels. So each frame of the browser is decoded strictly and encoded again, and one that is not
exactly one of the listed messages is dropped.
"""

import asyncio
import gzip
import socket
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

import msgspec
import websockets
from fastapi import APIRouter, Request, Response
from msgspec import Meta, Struct
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from rolling_panda.messages.types import Finite, Metre, Reason, Unit, Vector3
from server.auth.sessions import Session
from server.connections.websocket_protocol import why_ended
from server.scene.viser_adapter.contract import CLIENT_START, VERSION, client_page
from server.scene.viser_adapter.view_server import ViewServer

_QuatWxyz = tuple[Unit, Unit, Unit, Unit]
_Screen = tuple[Finite, Finite]
_NodeName = Annotated[str, Meta(max_length=200)]
_Owner = Annotated[str, Meta(max_length=100)]
_Modifier = Annotated[str, Meta(max_length=40)]
_Pixels = Annotated[int, Meta(ge=0, le=1 << 16)]


class _ClientMessage(Struct, frozen=True, tag_field="type", forbid_unknown_fields=True):
    """Root of the client's messages; the tag is viser's class name."""


class ViewerCamera(_ClientMessage, frozen=True, tag="ViewerCameraMessage"):
    """The view's camera. Every role may send it."""

    wxyz: _QuatWxyz
    position: Vector3
    fov: Finite
    near: Finite
    far: Finite
    image_height: _Pixels
    image_width: _Pixels
    look_at: Vector3
    up_direction: Vector3


class SceneNodeClick(_ClientMessage, frozen=True, tag="SceneNodeClickMessage"):
    """A click on a node of the scene."""

    name: _NodeName
    instance_index: int | None
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: _Screen
    modifier: _Modifier | None
    owner: _Owner = ""


class ScenePointer(_ClientMessage, frozen=True, tag="ScenePointerMessage"):
    """A click anywhere in the scene, while a session places points or measures."""

    event_type: Literal["click"]
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: tuple[_Screen]
    modifier: _Modifier | None


class GizmoUpdate(_ClientMessage, frozen=True, tag="TransformControlsUpdateMessage"):
    """The gizmo was dragged to this pose."""

    name: Literal["/gizmo"]
    wxyz: _QuatWxyz
    position: tuple[Metre, Metre, Metre]
    owner: _Owner = ""


class GizmoDragStart(_ClientMessage, frozen=True, tag="TransformControlsDragStartMessage"):
    """The gizmo was grabbed."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


class GizmoDragEnd(_ClientMessage, frozen=True, tag="TransformControlsDragEndMessage"):
    """The gizmo was released."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


_Message = ViewerCamera | SceneNodeClick | ScenePointer | GizmoUpdate | GizmoDragStart | GizmoDragEnd
#: Every message that a browser may send.
CLIENT_MESSAGES: tuple[type[Struct], ...] = get_args(_Message)
_DECODER: msgspec.msgpack.Decoder[_Message] = msgspec.msgpack.Decoder(_Message, strict=True)
_ENCODER = msgspec.msgpack.Encoder()


@dataclass(frozen=True)
class Admitted:
    """A valid frame.

    Attributes:
        frame: To pass on to viser; empty to pass on nothing, as with all messages about the gizmo. Viser would store
            the dragged pose late, and then not draw the gizmo back at its earlier pose.
        gizmo: The gizmo's drag, where it is permitted, or the end of one.
    """

    frame: bytes
    gizmo: GizmoUpdate | GizmoDragEnd | None = None


def admit(frame: bytes, may_operate: bool, may_move: bool = True) -> Admitted | None:
    """Check a frame for viser; None where it is forged and has to be dropped.

    Args:
        frame: One binary WebSocket frame from a browser.
        may_operate: Whether the session's role may click and drag.
        may_move: Whether it may drag the gizmo now: nobody else holds control. A release always passes.
    """
    try:
        message = _DECODER.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    if not may_operate and not isinstance(message, ViewerCamera):
        return None
    if isinstance(message, GizmoUpdate):
        return Admitted(b"", message if may_move else None)
    if isinstance(message, GizmoDragEnd):
        return Admitted(b"", message)
    if isinstance(message, GizmoDragStart):
        return Admitted(b"")
    # Encoded again, so that viser reads exactly what was checked here.
    return Admitted(_ENCODER.encode(message))


def message_type(frame: bytes) -> str:
    """The type that a dropped frame claims, for the log."""
    try:
        decoded = msgspec.msgpack.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return "not a message"
    return str(decoded.get("type", "no type"))[:60] if isinstance(decoded, dict) else "not a message"


#: Viser's own panel and notifications are empty here and would cover the view.
_STYLE = b"<style>[data-floating-window],.mantine-Notifications-root{display:none!important}</style>"
#: A script of the page that configures the rendering; it has to run before the client's scripts.
_SCRIPT = b'<script type="module" src="/js/scene/frame.js"></script>'
#: The client starts as soon as it is unpacked; patched, it waits for that script, or for the failure to load it.
_PATCHED_START = b'await Promise.all([init(),import("/js/scene/frame.js").catch(()=>{})]);'


def viser_router(
    views: ViewServer,
    may_move: Callable[[Session], bool],
    on_gizmo: Callable[[Session, GizmoUpdate | GizmoDragEnd], object],
    on_drop: Callable[[Session, str], None],
    on_end: Callable[[Session, Reason], None],
) -> APIRouter:
    """Routes `/viser/` and the WebSocket `/viser`.

    Args:
        views: The viser server.
        may_move: Whether this session may move the robot now.
        on_gizmo: Called at once with a permitted drag of the gizmo, and with every release; viser's own callback would
            come two threads later.
        on_drop: Called with the session and the message type of a dropped frame.
        on_end: Called with the session of a view that the server has closed, and the reason.
    """
    router = APIRouter(include_in_schema=False)
    page = _patched_client_page()
    compressed = gzip.compress(page, 6)

    @router.get("/viser/")
    def view(request: Request) -> Response:
        headers = {"Cache-Control": "private, no-cache", "ETag": f'"viser-{VERSION}-{len(page)}"'}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            headers["Content-Encoding"] = "gzip"
            return Response(compressed, media_type="text/html", headers=headers)
        return Response(page, media_type="text/html", headers=headers)

    @router.websocket("/viser")
    async def link(websocket: WebSocket) -> None:
        session: Session = websocket.state.session

        def filtered(frame: bytes) -> bytes:
            """The frame to pass on; empty for none."""
            admitted = admit(frame, session.may_operate, may_move(session))
            if admitted is None:
                on_drop(session, message_type(frame))
                return b""
            if admitted.gizmo is not None:
                on_gizmo(session, admitted.gizmo)
            return admitted.frame

        offered = [Subprotocol(name) for name in websocket.scope.get("subprotocols", ())]
        with socket.socket() as local:
            local.setblocking(False)
            local.bind(("127.0.0.1", 0))
            port = int(local.getsockname()[1])
            views.expect(port, session.session_id, session.may_operate)
            try:
                await asyncio.get_running_loop().sock_connect(local, ("127.0.0.1", views.port))
                async with connect(
                    f"ws://127.0.0.1:{views.port}/",
                    sock=local,
                    subprotocols=offered or None,
                    compression=None,
                    max_size=None,
                    max_queue=4,
                    proxy=None,
                ) as upstream:
                    await websocket.accept(subprotocol=upstream.subprotocol)
                    await _relay(websocket, upstream, session, _to_viser(websocket, upstream, filtered))
            except (OSError, websockets.InvalidHandshake):
                await websocket.close(1013, "the 3-D view is not running")
            finally:
                views.forget(port)
                if reason := why_ended(websocket.scope):
                    on_end(session, reason)

    return router


def _patched_client_page() -> bytes:
    """The client's page with our script and style."""
    return client_page().replace(CLIENT_START, _PATCHED_START).replace(b"<head>", b"<head>" + _SCRIPT + _STYLE, 1)


async def _relay(
    websocket: WebSocket,
    upstream: ClientConnection,
    session: Session,
    to_viser: Coroutine[Any, Any, None],
) -> None:
    """Relay frames both ways until either side closes or the session ends."""
    tasks = [
        asyncio.create_task(to_viser),
        asyncio.create_task(_to_browser(websocket, upstream)),
        asyncio.create_task(session.ended.wait()),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    if session.ended.is_set():
        await _close(websocket, 1008, "signed out")
    elif upstream.close_code is not None:
        # The client detects a version mismatch by this code.
        await _close(websocket, upstream.close_code, upstream.close_reason or "")


async def _to_viser(websocket: WebSocket, upstream: ClientConnection, filtered: Callable[[bytes], bytes]) -> None:
    try:
        while True:
            if frame := filtered(await websocket.receive_bytes()):
                await upstream.send(frame)
    except (WebSocketDisconnect, KeyError, websockets.ConnectionClosed):
        # KeyError: a text frame, which viser's client never sends.
        return


async def _to_browser(websocket: WebSocket, upstream: ClientConnection) -> None:
    try:
        # Nothing is queued here: while a browser does not read, viser keeps the newest of each message alone.
        async for frame in upstream:
            if isinstance(frame, bytes):
                await websocket.send_bytes(frame)
    except (websockets.ConnectionClosed, WebSocketDisconnect, RuntimeError):
        return


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    # Reserved codes mean that the connection broke and may not be sent.
    sendable = code if 1000 <= code <= 1003 or 1007 <= code <= 1014 else 1011
    try:
        await websocket.close(sendable, reason)
    except RuntimeError:
        return
