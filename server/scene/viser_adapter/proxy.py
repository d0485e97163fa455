"""The 3-D view on the page's own origin: its client page, and its WebSocket through the filter."""

import asyncio
import gzip
import math
import socket
from collections.abc import Callable, Coroutine
from typing import Any

import websockets
from fastapi import APIRouter, Request, Response
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from rolling_panda.messages.types import Reason
from server.auth.sessions import Session
from server.connections.websocket_protocol import why_ended
from server.scene.viser_adapter.client_messages import GizmoDragEnd, GizmoUpdate, admit, message_type
from server.scene.viser_adapter.contract import CLIENT_SCRIPT, CLIENT_START, VERSION, client_page
from server.scene.viser_adapter.view_server import ViewServer

#: Viser's own panel and notifications are empty here and would cover the view.
_STYLE = b"<style>[data-floating-window],.mantine-Notifications-root{display:none!important}</style>"
#: A script of the page that configures the rendering; it has to run before the client's scripts.
_SCRIPT = b'<script type="module" src="/js/scene/frame.js"></script>'
#: The client starts as soon as it is unpacked; patched, it waits for that script, or for the failure to load it.
_PATCHED_START = b'await Promise.all([init(),import("/js/scene/frame.js").catch(()=>{})]);'

#: The camera's wheel and pinch zoom into the middle of the view, mostly into the arm; patched, towards the pointer. The
#: option is one of `camera-controls`, which the client does not set.
_PATCHED_SCRIPT = CLIENT_SCRIPT.replace(b";", b'.replace("dollySpeed:.3,","dollySpeed:.3,dollyToCursor:true,");')


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
            views.expect(port, session.session_id, session.may_operate, _pixel_ratio(websocket))
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


def _pixel_ratio(websocket: WebSocket) -> float:
    """Pixels of a CSS pixel, which `frame.js` has set as a cookie: viser tells the size of the view in pixels alone."""
    try:
        ratio = float(websocket.cookies.get("view-ratio", "1"))
    except ValueError:
        return 1.0
    return min(max(ratio, 0.5), 4.0) if math.isfinite(ratio) else 1.0


def _patched_client_page() -> bytes:
    """The client's page with our script and style."""
    page = client_page().replace(CLIENT_START, _PATCHED_START).replace(CLIENT_SCRIPT, _PATCHED_SCRIPT)
    return page.replace(b"<head>", b"<head>" + _SCRIPT + _STYLE, 1)


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
