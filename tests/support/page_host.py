"""A web server on a loopback port, for browsers that are shown a played page: HTTP and WebSockets as the page has them.

The browser caches the page's files, which it would not where its requests are intercepted.
"""

import asyncio
import itertools
import json
import socket
import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Protocol

import uvicorn
from playwright.sync_api import Page
from starlette.requests import ClientDisconnect, Request, cookie_parser
from starlette.responses import Response
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

ORIGIN = "http://panda.test"
#: A page without scripts and requests.
NOTHING = f"{ORIGIN}/nothing"
#: Answers after as many seconds as its query says.
_STILL = "/still"
#: The page's thread stands still for some seconds, as in a long task, which would keep a processor from other tests.
STAND_STILL = f"""seconds => {{
  const asked = new XMLHttpRequest();
  asked.open("GET", `{_STILL}?${{seconds}}`, false);
  asked.send();
}}"""
_COOKIE = "played"


@dataclass(frozen=True)
class PlayedRequest:
    """What a browser asks."""

    method: str
    #: With the query.
    target: str
    content: bytes

    @property
    def path(self) -> str:
        return self.target.split("?")[0]

    @cached_property
    def body(self) -> Any:
        """The JSON that was sent; None without any."""
        return json.loads(self.content) if self.content else None


class PlayedSocket:
    """A WebSocket of a page, which any thread may use."""

    def __init__(self, websocket: WebSocket) -> None:
        self.path = websocket.url.path
        self._websocket = websocket
        self._loop = asyncio.get_running_loop()
        self._unsent: asyncio.Queue[str | tuple[int, str]] = asyncio.Queue()

    def send(self, text: str) -> None:
        self._loop.call_soon_threadsafe(self._unsent.put_nowait, text)

    def close(self, code: int = 1000, reason: str = "") -> None:
        self._loop.call_soon_threadsafe(self._unsent.put_nowait, (code, reason))

    async def write(self) -> None:
        """Send what is to be sent, until it is closed."""
        with suppress(WebSocketDisconnect, RuntimeError):
            while isinstance(message := await self._unsent.get(), str):
                await self._websocket.send_text(message)
            await self._websocket.close(*message)


class Site(Protocol):
    """What a test plays. All of it is called by the host's thread."""

    def answer(self, request: PlayedRequest) -> Response | None:
        """The answer; None breaks the connection."""

    def accept(self, socket: PlayedSocket) -> bool:
        """Whether to open this WebSocket."""

    def hear(self, socket: PlayedSocket, text: str) -> None:
        """A message of a page."""


class _Breakable(H11Protocol):
    """Uvicorn's, with the connection in the scope."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.app_state = {"transport": transport}


class PageHost:
    """Serves sites under one origin, so that they share the browser's cache; a cookie tells them apart."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self._sites: dict[str, Site] = {}
        self._names = (str(number) for number in itertools.count())
        listener = socket.create_server(("127.0.0.1", 0))
        #: With these a browser finds the host.
        port = listener.getsockname()[1]
        self.flags = (f"--host-resolver-rules=MAP panda.test 127.0.0.1:{port}", "--no-proxy-server")
        config = uvicorn.Config(
            self._serve,
            interface="asgi3",
            http=_Breakable,
            ws="websockets-sansio",
            ws_per_message_deflate=False,
            lifespan="off",
            access_log=False,
            log_level="critical",
        )
        threading.Thread(target=uvicorn.Server(config).run, args=([listener],), daemon=True).start()

    def show(self, page: Page, site: Site) -> None:
        """From now on this page, and others of its context, are the site's."""
        name = next(self._names)
        self._sites[name] = site
        page.context.add_cookies([{"name": _COOKIE, "value": name, "url": ORIGIN}])

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            if scope["type"] == "websocket":
                await self._socket(WebSocket(scope, receive, send))
            else:
                await (await self._answer(Request(scope, receive)))(scope, receive, send)
        except ClientDisconnect:
            # The page was left, or the site has broken the connection.
            return
        except Exception as error:
            self.problems.append(f"{scope['path']}: {error!r}")
            raise

    def _site(self, request: Request | WebSocket) -> Site | None:
        return self._sites.get(cookie_parser(request.headers.get("cookie", "")).get(_COOKIE, ""))

    async def _answer(self, request: Request) -> Response:
        path, query, site = request.url.path, request.url.query, self._site(request)
        if path == _STILL:
            await asyncio.sleep(float(query))
            return Response()
        if path == "/nothing":
            return Response("<!doctype html><link rel=icon href=data:,>", media_type="text/html")
        asked = PlayedRequest(request.method, f"{path}?{query}" if query else path, await request.body())
        answer = None if site is None else site.answer(asked)
        if answer is None:
            request.state.transport.abort()
            raise ClientDisconnect
        return answer

    async def _socket(self, websocket: WebSocket) -> None:
        site = self._site(websocket)
        socket = PlayedSocket(websocket)
        if site is None or not site.accept(socket):
            await websocket.close()
            return
        await websocket.accept()
        writing = asyncio.create_task(socket.write())
        try:
            while (message := await websocket.receive())["type"] == "websocket.receive":
                site.hear(socket, message["text"])
        finally:
            writing.cancel()


@cache
def page_host() -> PageHost:
    """The one of this process."""
    return PageHost()
