"""ASGI middleware: checks origin, session and size of every request, and sets the security headers of every response.

Paths under `/api/`, `/camera/`, `/viser` and `/robots`, and all WebSockets need a session, except the few listed paths.
"""

import asyncio
import time
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie

import msgspec
from starlette.datastructures import MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.token_bucket import TokenBuckets
from server.api.responses import outcome
from server.auth.sessions import Session, Sessions
from server.connections.http_protocol import OPTIONAL_BODY

_PUBLIC_PATHS = frozenset({"/api/sign-in", "/api/health", "/api/openapi.json"})
#: Wait for an optional body (s).
_OPTIONAL_BODY_S = 0.25
#: Rate limit and burst of one address without a session; further requests wait, up to this time (s).
_VISITOR_RATE_HZ, _VISITOR_BURST, _MAX_WAIT_S = 200.0, 400.0, 5.0
_RETRY_S = 0.1
_PROTECTED = ("/api", "/camera", "/viser", "/ws", "/robots")
_SAFE_METHODS = frozenset({"GET", "HEAD"})

PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'"
)
#: The 3-D client is one file with inline script, WebAssembly and blobs. It may be framed by our page only.
VIEW_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; connect-src 'self' blob: data:; img-src 'self' data: blob:; "
    "style-src 'self' 'unsafe-inline'; font-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "frame-ancestors 'self'"
)


class SecurityMiddleware:
    """ASGI middleware around the whole application."""

    def __init__(
        self,
        app: ASGIApp,
        sessions: Sessions,
        origins: frozenset[str],
        cookie: str,
        max_body: int,
        on_refusal: Callable[[Reason], None],
    ) -> None:
        """Wrap `app`; `on_refusal(reason)` is called with refused origins."""
        self._app = app
        self._sessions = sessions
        self._origins = origins
        self._cookie = cookie
        self._max_body = max_body
        self._on_refusal = on_refusal
        self._visitors = TokenBuckets(_VISITOR_RATE_HZ, _VISITOR_BURST)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on or refuse it."""
        if scope["type"] == "http":
            await self._http(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        path: str = scope["path"]

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                _add_headers(MutableHeaders(scope=message), path, scope.get("scheme") == "https")
            await send(message)

        session = self.session(scope)
        if session is None and not await self._within_rate_limit(scope):
            await _refuse(with_headers, 429, reasons.visitor_rate_exceeded())
            return
        if scope["method"] not in _SAFE_METHODS and not self._origin_allowed(scope):
            await _refuse(with_headers, 403, reasons.origin_foreign())
            return
        if session is None and not is_public(path):
            await _refuse(with_headers, 401, reasons.not_signed_in())
            return
        is_optional = OPTIONAL_BODY.fullmatch(path) is not None
        try:
            async with asyncio.timeout(_OPTIONAL_BODY_S if is_optional else None):
                body = await _read_body(receive, self._max_body)
        except (TimeoutError, ClientDisconnect):
            if not is_optional:
                return
            body = None
        if body is None and is_optional:
            body = b""
        if body is None:
            await _refuse(with_headers, 413, reasons.body_too_long(float(self._max_body)))
            return
        scope.setdefault("state", {})["session"] = session
        await self._app(scope, _BufferedBody(body, receive), with_headers)

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        session = self.session(scope)
        if session is None or not self._origin_allowed(scope):
            await receive()
            # Closing before accepting makes the HTTP answer 403.
            await send({"type": "websocket.close", "code": 1008, "reason": "sign in first"})
            return
        scope.setdefault("state", {})["session"] = session
        await self._app(scope, receive, send)

    async def _within_rate_limit(self, scope: Scope) -> bool:
        """Wait while this address makes too many requests without a session; False after too long."""
        address = scope["client"][0] if scope.get("client") else ""
        until = time.monotonic() + _MAX_WAIT_S
        while not self._visitors.take(address, now := time.monotonic()):
            if now > until:
                return False
            await asyncio.sleep(_RETRY_S)
        return True

    def session(self, scope: Scope) -> Session | None:
        """The session of a request's cookie."""
        for name, value in scope["headers"]:
            if name == b"cookie":
                try:
                    morsel = SimpleCookie(value.decode("latin-1")).get(self._cookie)
                except CookieError:
                    continue
                if morsel is not None:
                    return self._sessions.find(morsel.value, time.monotonic())
        return None

    def _origin_allowed(self, scope: Scope) -> bool:
        origins = [value.decode("latin-1") for name, value in scope["headers"] if name == b"origin"]
        if len(origins) == 1 and origins[0] in self._origins:
            return True
        path, named = scope["path"][:80], ", ".join(origins)[:80]
        self._on_refusal(reasons.origin_refused(path, named) if named else reasons.origin_missing(path))
        return False


class _BufferedBody:
    """Gives the application the buffered body, then the further messages of the connection."""

    def __init__(self, body: bytes, receive: Receive) -> None:
        self._body: bytes | None = body
        self._receive = receive

    async def __call__(self) -> Message:
        if self._body is None:
            return await self._receive()
        body, self._body = self._body, None
        return {"type": "http.request", "body": body, "more_body": False}


def is_protected(path: str) -> bool:
    """Whether this path needs a session, unless it is listed as public."""
    return any(path == root or path.startswith(root + "/") for root in _PROTECTED)


def is_public(path: str) -> bool:
    """Whether this path is served without a session."""
    return path in _PUBLIC_PATHS or not is_protected(path)


async def _read_body(receive: Receive, limit: int) -> bytes | None:
    body = b""
    while True:
        message = await receive()
        if message["type"] != "http.request":
            raise ClientDisconnect
        chunk: bytes = message.get("body", b"")
        body += chunk
        if len(body) > limit:
            return None
        if not message.get("more_body", False):
            return body


async def _refuse(send: Send, status: int, reason: Reason) -> None:
    body = msgspec.json.encode(outcome(False, reason))
    headers = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def _add_headers(headers: MutableHeaders, path: str, secure: bool) -> None:
    view = path == "/viser" or path.startswith("/viser/")
    headers["Content-Security-Policy"] = VIEW_POLICY if view else PAGE_POLICY
    if secure:
        headers["Strict-Transport-Security"] = "max-age=31536000"
    headers["X-Content-Type-Options"] = "nosniff"
    # "no-referrer" would make browsers send `Origin: null` with some of the page's own requests.
    headers["Referrer-Policy"] = "same-origin"
    headers["Cross-Origin-Opener-Policy"] = "same-origin"
    headers["Cross-Origin-Resource-Policy"] = "same-origin"
    headers.setdefault("Cache-Control", "no-store" if is_protected(path) else "no-cache")
