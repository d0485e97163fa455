"""The application: routes, error answers and the guard around them."""

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.routing import Match, Mount
from starlette.types import ASGIApp, Scope

from rolling_panda import __version__
from rolling_panda.messages.page import PageEvents, PagePoints, PageState
from rolling_panda.messages.supervision import SessionPlan, SessionReport
from rolling_panda.messages.types import Severity
from rolling_panda.resources import resource
from server.api.answers import answer
from server.api.camera import camera_router
from server.api.control import Control, control_router
from server.api.guard import Guard, is_open, is_protected
from server.api.operator import operator_router
from server.api.order import order_router
from server.api.page_files import PageFiles
from server.api.pages import pages_router
from server.api.plant import plant_router
from server.api.preview import Previewed, preview_router
from server.api.replay import replay_router
from server.api.report import report_router
from server.api.robot import robot_router
from server.api.robots import path_of, robots_router
from server.api.site import page_router, site_router
from server.auth.sessions import Session
from server.robot_router import RobotRouter
from server.robots.app_state import AppState
from server.robots.context import Result, RobotContext
from server.scene.viser_proxy import viser_router

_ABOUT = (
    "Everything that the page can do. Sign in with `POST /api/sign-in` and the token of a sign-in link, keep the "
    "cookie, and send an `Origin` header with the server's own address on every POST. A link signs in once; "
    "`POST /api/invite` makes another one for a script. Requests without fields do not read their body. "
    "Units are SI; frames follow REP-105."
)


#: What requests are answered with that FastAPI does not know.
_MESSAGES = (PageState, PagePoints, PageEvents, SessionPlan, SessionReport, Previewed, Control)


class _Application(FastAPI):
    """Describes the page's own messages and the session's cookie too, which FastAPI does not know."""

    cookie = ""

    def openapi(self) -> dict[str, Any]:
        document = super().openapi()
        _, messages = msgspec.json.schema_components(_MESSAGES, ref_template="#/components/schemas/{name}")
        components = document.setdefault("components", {})
        components.setdefault("schemas", {}).update(messages)
        components["securitySchemes"] = {"session": {"type": "apiKey", "in": "cookie", "name": self.cookie}}
        for path, methods in document["paths"].items():
            for operation in methods.values():
                operation["security"] = [] if is_open(path) else [{"session": []}]
        return document


class _PageFiles(Mount):
    """The page's files. Under the paths of the API there are none, so what is asked there is not theirs to refuse."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        return (Match.NONE, {}) if is_protected(scope["path"]) else super().matches(scope)


def create_app(reception: AppState, origins: frozenset[str]) -> ASGIApp:
    """The guarded application; `origins` are the exact origins that the page may have.

    One robot is at `/`. Several are at `/robots/NAME/` each, and `/` has what is about all of them.
    """
    if len(reception.desks) == 1:
        (desk,) = reception.desks.values()
        return robot_app(reception, desk, origins)
    robots = {name: robot_app(reception, desk, origins, path_of(name)) for name, desk in reception.desks.items()}
    return RobotRouter(robots, _hall(reception, origins))


def robot_app(reception: AppState, desk: RobotContext, origins: frozenset[str], path: str = "/") -> ASGIApp:
    """Everything about one robot, which is at this path."""

    def dropped(session: Session, kind: str) -> None:
        desk.note("warning", f"a view of {session.user} sent {kind!r} to the 3-D view; dropped", session.client)

    def ended(session: Session, reason: str) -> None:
        desk.note("warning", f"a view of {session.user} was closed: {reason}", session.client)

    files = PageFiles(web := resource("web"))
    routers = (
        page_router(web, files),
        site_router(reception),
        camera_router(desk),
        operator_router(desk),
        plant_router(desk),
        order_router(desk),
        preview_router(desk),
        control_router(desk),
        robot_router(desk),
        replay_router(desk),
        report_router(desk),
        pages_router(desk),
        viser_router(desk.scene, desk.may_move, desk.dragged, dropped, ended),
    )
    return _guarded(routers, files, reception, origins, desk.note, path)


def _hall(reception: AppState, origins: frozenset[str]) -> ASGIApp:
    """What several robots have in common."""
    first = path_of(next(iter(reception.desks)))
    files = PageFiles(web := resource("web"))
    routers = (page_router(web, files, first), site_router(reception), robots_router(reception))
    return _guarded(routers, files, reception, origins, reception.note)


def _guarded(
    routers: Sequence[APIRouter],
    files: PageFiles,
    reception: AppState,
    origins: frozenset[str],
    note: Callable[[Severity, str, str], None],
    path: str = "/",
) -> ASGIApp:
    app = _Application(
        title="Rolling Panda",
        version=__version__,
        description=_ABOUT,
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        servers=None if path == "/" else [{"url": path.rstrip("/")}],
    )
    app.cookie = reception.cookie
    for router in routers:
        app.include_router(router)
    app.router.routes.append(_PageFiles("/", files, name="web"))
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _failed)
    return Guard(
        files.before(app),
        reception.sessions,
        origins,
        reception.cookie,
        reception.max_body_bytes,
        on_refusal=lambda text: note("warning", text, "a foreign page"),
    )


async def _invalid(_: Request, error: Exception) -> JSONResponse:
    """Validation errors in words: which field, what is wrong."""
    problems = error.errors() if isinstance(error, RequestValidationError) else []
    words = [f"{'.'.join(str(part) for part in problem['loc'])}: {problem['msg']}" for problem in problems[:5]]
    return answer(Result(422, False, "; ".join(words)[:500] or "the request is wrong"))


async def _failed(request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, HTTPException):
        return answer(Result(500, False, ""))
    if error.status_code == 400:
        # FastAPI's answer to bytes that are no text.
        return answer(Result(422, False, "the body is not JSON in UTF-8"))
    told = answer(Result(error.status_code, False, str(error.detail)[:500]))
    told.headers.update(error.headers or {})
    if error.status_code == 405:
        # Each route knows of its own method alone, and two may share a path.
        path = getattr(request.scope.get("route"), "path_format", "")
        told.headers["Allow"] = ", ".join(request.app.openapi()["paths"].get(path, {"get": None})).upper()
    return told
