"""The labelling page's routes: list, pictures, masks and proposals. Only sessions of the printed link may use them."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from labelling.pictures import ChangedMaskError, Pictures, packed
from labelling.proposals import Proposals
from perception.dataset.dataset import MASKS, VALUES, Split
from rolling_panda import reasons
from rolling_panda.errors import RollingPandaError
from rolling_panda.resources import resource
from server.api.middleware import SecurityMiddleware
from server.api.responses import RefusedError, outcome
from server.auth.sessions import Sessions, SignInError

#: Longest body: a mask, compressed.
_MAX_BODY = 16 << 20
#: Of `web/`, that the page needs.
_FOLDERS = ("css", "js", "components", "text")
Found = TypeVar("Found")


class _SignIn(msgspec.Struct, forbid_unknown_fields=True):
    token: str


class _Assign(msgspec.Struct, forbid_unknown_fields=True):
    split: Split


def create_app(
    pictures: Pictures, proposals: Proposals, sessions: Sessions, origins: frozenset[str], cookie: str
) -> ASGIApp:
    """The application.

    Args:
        pictures: To label.
        proposals: Of the network.
        sessions: With the token of the printed link.
        origins: Exact origins of the page; a change that another page asks for is refused.
        cookie: Name of the session's cookie.
    """
    app = FastAPI(title="Rolling Panda: labels", openapi_url=None, docs_url=None, redoc_url=None)
    web = resource("web")

    # FastAPI runs these functions on its thread pool, since they read and write files.
    @app.get("/")
    def page(request: Request) -> Response:
        return FileResponse(web / ("sign-in.html" if request.state.session is None else "label.html"))

    @app.get("/sign-in")
    def sign_in_page() -> Response:
        return FileResponse(web / "sign-in.html")

    @app.get("/icon.svg")
    def icon() -> Response:
        return FileResponse(web / "icon.svg")

    @app.get("/api/sign-in")
    def sign_in_method() -> dict[str, bool]:
        return {"password": False}

    @app.post("/api/sign-in")
    async def sign_in(request: Request) -> Response:
        asked = _decoded(await request.body(), _SignIn)
        address = "" if request.client is None else request.client.host
        try:
            session = sessions.sign_in(asked.token, time.monotonic(), address)
        except SignInError as error:
            return JSONResponse(outcome(False, error.reason), 401)
        answer = JSONResponse(outcome(True))
        answer.set_cookie(cookie, session.session_id, httponly=True, samesite="strict", path="/")
        return answer

    @app.get("/api/pictures")
    def rows() -> Response:
        manifest, found = _usable(pictures.rows)
        return _json(
            {
                "folder": str(pictures.folder),
                "source": manifest.source,
                "licence": manifest.licence,
                "masks": MASKS,
                "classes": VALUES,
                "model": proposals.title,
                "pictures": found,
            }
        )

    @app.get("/api/pictures/{name}")
    def picture(name: str) -> Response:
        content, media = _usable(lambda: pictures.picture(name))
        return Response(content, media_type=media)

    @app.get("/api/pictures/{name}/small")
    def small(name: str) -> Response:
        content = _usable(lambda: pictures.small(name))
        return Response(content, media_type="image/jpeg", headers={"Cache-Control": "private, max-age=3600"})

    @app.get("/api/pictures/{name}/mask")
    def mask(name: str) -> Response:
        found = _usable(lambda: pictures.mask(name))
        height, width = found.labels.shape
        return _values(packed(found.labels), {"Revision": found.revision, "Picture-Size": f"{width}x{height}"})

    @app.put("/api/pictures/{name}/mask")
    async def save(name: str, request: Request) -> Response:
        content, was = await request.body(), request.headers.get("revision", "")
        row, revision = await run_in_threadpool(_usable, lambda: pictures.save(name, content, was))
        return _json({"ok": True, "reason": "", "row": row, "revision": revision})

    @app.get("/api/pictures/{name}/proposal")
    def proposal(name: str) -> Response:
        return _values(_usable(lambda: proposals.of(pictures.path(name))), {})

    @app.post("/api/pictures/{name}/split")
    async def assign(name: str, request: Request) -> Response:
        asked = _decoded(await request.body(), _Assign)
        row = await run_in_threadpool(_usable, lambda: pictures.assign(name, asked.split))
        return _json({"ok": True, "reason": "", "row": row})

    for folder in _FOLDERS:
        app.router.routes.append(Mount(f"/{folder}", StaticFiles(directory=web / folder)))
    app.add_exception_handler(HTTPException, _http_error)
    return SecurityMiddleware(app, sessions, origins, cookie, _MAX_BODY, on_refusal=lambda reason: None)


def _usable(ask: Callable[[], Found]) -> Found:
    """What `ask` finds; an error of the program's own becomes an answer with its text."""
    try:
        return ask()
    except ChangedMaskError as error:
        raise RefusedError(409, reasons.mask_changed(str(error))) from error
    except (RollingPandaError, OSError) as error:
        raise RefusedError(422, reasons.label_file_unusable(str(error))) from error


def _decoded(content: bytes, kind: type[Found]) -> Found:
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise RefusedError(422, reasons.request_invalid(str(error))) from error


def _json(content: Any) -> Response:
    return Response(msgspec.json.encode(content), media_type="application/json")


def _values(content: bytes, headers: dict[str, str]) -> Response:
    """Packed values of pixels, which the browser unpacks."""
    return Response(content, media_type="application/octet-stream", headers={"Content-Encoding": "deflate"} | headers)


async def _http_error(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    told = error.reason if isinstance(error, RefusedError) else None
    reason = told or reasons.http_error(error.status_code, str(error.detail)[:400])
    return JSONResponse(outcome(False, reason), error.status_code, error.headers)
