"""The 3-D view on the page's own origin: its client page, and its WebSocket through the filter."""

import asyncio
import gzip
import socket
from collections.abc import Callable, Coroutine
from typing import Any

import websockets
from fastapi import APIRouter, Request, Response
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from rolling_panda.errors import RollingPandaError
from server.auth.sessions import Session
from server.connections.websocket_protocol import why_ended
from server.scene.scene import VIEW_VERSION, Scene, view_page
from server.scene.viser_filter import GizmoDragEnd, GizmoUpdate, admit, kind

#: Viser's own panel and notices have nothing to say here, and would cover the view.
_STYLE = b"<style>[data-floating-window],.mantine-Notifications-root{display:none!important}</style>"
#: The page's own file on how the view is drawn; it has to run before the client's scripts.
_SCRIPT = b'<script type="module" src="/js/scene/frame.js"></script>'
#: The client unpacks itself, and would run whether that file has come or not; without it, it does all the same.
_UNPACKS, _WAITS = b"await init();", b'await Promise.all([init(),import("/js/scene/frame.js").catch(()=>{})]);'


def viser_router(
    scene: Scene,
    may_move: Callable[[Session], bool],
    on_gizmo: Callable[[Session, GizmoUpdate | GizmoDragEnd], object],
    on_drop: Callable[[Session, str], None],
    on_end: Callable[[Session, str], None],
) -> APIRouter:
    """Routes `/viser/` and the WebSocket `/viser`.

    Args:
        scene: What is shown.
        may_move: Whether this session may lead the tool now.
        on_gizmo: Hears at once where a session that may has dragged its gizmo, and when anybody has let go of theirs;
            viser would tell it two threads later.
        on_drop: Hears of refused frames: whose, and what they said they were.
        on_end: Hears whose view the server has ended, and why.
    """
    router = APIRouter(include_in_schema=False)
    page = _view_page()
    compressed = gzip.compress(page, 6)

    @router.get("/viser/")
    def view(request: Request) -> Response:
        headers = {"Cache-Control": "private, no-cache", "ETag": f'"viser-{VIEW_VERSION}-{len(page)}"'}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            headers["Content-Encoding"] = "gzip"
            return Response(compressed, media_type="text/html", headers=headers)
        return Response(page, media_type="text/html", headers=headers)

    @router.websocket("/viser")
    async def link(websocket: WebSocket) -> None:
        session: Session = websocket.state.session

        def heard(frame: bytes) -> bytes:
            """What of a frame to pass on; empty where nothing."""
            admitted = admit(frame, session.may_operate, may_move(session))
            if admitted is None:
                on_drop(session, kind(frame))
                return b""
            if admitted.gizmo is not None:
                on_gizmo(session, admitted.gizmo)
            return admitted.frame

        offered = [Subprotocol(name) for name in websocket.scope.get("subprotocols", ())]
        with socket.socket() as near:
            near.setblocking(False)
            near.bind(("127.0.0.1", 0))
            port = int(near.getsockname()[1])
            scene.door.expect(port, session.session_id, session.may_operate)
            try:
                await asyncio.get_running_loop().sock_connect(near, ("127.0.0.1", scene.port))
                async with connect(
                    f"ws://127.0.0.1:{scene.port}/",
                    sock=near,
                    subprotocols=offered or None,
                    compression=None,
                    max_size=None,
                    max_queue=4,
                    proxy=None,
                ) as upstream:
                    await websocket.accept(subprotocol=upstream.subprotocol)
                    await _relay(websocket, upstream, session, _to_viser(websocket, upstream, heard))
            except (OSError, websockets.InvalidHandshake):
                await websocket.close(1013, "the 3-D view is not running")
            finally:
                scene.door.forget(port)
                if reason := why_ended(websocket.scope):
                    on_end(session, reason)

    return router


def _view_page() -> bytes:
    """The client's page with what is the page's own."""
    page = view_page()
    if page.count(_UNPACKS) != 1:
        raise RollingPandaError(f"viser {VIEW_VERSION} has another client than the one that is known")
    return page.replace(_UNPACKS, _WAITS).replace(b"<head>", b"<head>" + _SCRIPT + _STYLE, 1)


async def _relay(
    websocket: WebSocket,
    upstream: ClientConnection,
    session: Session,
    to_viser: Coroutine[Any, Any, None],
) -> None:
    """Carry frames both ways until either side closes or the session ends."""
    legs = [
        asyncio.create_task(to_viser),
        asyncio.create_task(_to_browser(websocket, upstream)),
        asyncio.create_task(session.ended.wait()),
    ]
    try:
        await asyncio.wait(legs, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for leg in legs:
            leg.cancel()
        await asyncio.gather(*legs, return_exceptions=True)
    if session.ended.is_set():
        await _close(websocket, 1008, "signed out")
    elif upstream.close_code is not None:
        # The client shows a version mismatch by this code, so it must arrive.
        await _close(websocket, upstream.close_code, upstream.close_reason or "")


async def _to_viser(websocket: WebSocket, upstream: ClientConnection, heard: Callable[[bytes], bytes]) -> None:
    try:
        while True:
            if frame := heard(await websocket.receive_bytes()):
                await upstream.send(frame)
    except (WebSocketDisconnect, KeyError, websockets.ConnectionClosed):
        # KeyError: a text frame, which viser's client never sends.
        return


async def _to_browser(websocket: WebSocket, upstream: ClientConnection) -> None:
    try:
        # Nothing is queued here: while a browser does not read, viser keeps only the newest of each message.
        async for frame in upstream:
            if isinstance(frame, bytes):
                await websocket.send_bytes(frame)
    except (websockets.ConnectionClosed, WebSocketDisconnect, RuntimeError):
        return


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    # Codes that may not be sent say that the connection broke.
    sendable = code if 1000 <= code <= 1003 or 1007 <= code <= 1014 else 1011
    try:
        await websocket.close(sendable, reason)
    except RuntimeError:
        return
