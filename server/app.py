"""The application: routes, error responses and the middleware around them."""

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.routing import Match, Mount
from starlette.types import ASGIApp, Scope

from rolling_panda import __version__, reasons
from rolling_panda.messages.page import Diagnostics, PageEvents, PagePoints, PageState
from rolling_panda.messages.perception import CameraState, RobotCalibration, SpurDrawing
from rolling_panda.messages.supervision import SessionPlan, SessionReport, Timeline
from rolling_panda.messages.types import Reason
from rolling_panda.resources import resource
from server.api.commands import Control, commands_router, control_router
from server.api.middleware import SecurityMiddleware, is_protected, is_public
from server.api.page_files import PageFiles
from server.api.page_socket import page_socket_router
from server.api.plant import plant_router
from server.api.preview import Previewed, preview_router
from server.api.responses import RefusedError, answer
from server.api.robots import RobotRouter, path_of, robots_router
from server.api.sign_in import page_router, sign_in_router
from server.api.state import camera_router, state_router
from server.auth.sessions import Session
from server.robots.app_state import AppState
from server.robots.context import RobotContext
from server.robots.link import Result
from server.scene.viser_adapter.proxy import viser_router

_ABOUT = (
    "Everything that the page can do. Sign in with `POST /api/sign-in` and the token of a sign-in link, keep the "
    "cookie, and send an `Origin` header with the server's own address on every POST. A link signs in once; "
    "`POST /api/invite` makes another one for a script. Requests without fields do not read their body. "
    "Units are SI; frames follow REP-105."
)


#: Response types that are no Pydantic models.
_MESSAGES = (
    *(
        PageState,
        PagePoints,
        PageEvents,
        SessionPlan,
        SessionReport,
        CameraState,
        RobotCalibration,
        Previewed,
        Control,
        SpurDrawing,
    ),
    *(Diagnostics, Timeline),
)


class _Application(FastAPI):
    """Adds the msgspec messages and the session cookie to the OpenAPI document."""

    cookie = ""

    def openapi(self) -> dict[str, Any]:
        document = super().openapi()
        _, messages = msgspec.json.schema_components(_MESSAGES, ref_template="#/components/schemas/{name}")
        components = document.setdefault("components", {})
        components.setdefault("schemas", {}).update(messages)
        components["securitySchemes"] = {"session": {"type": "apiKey", "in": "cookie", "name": self.cookie}}
        for path, methods in document["paths"].items():
            for operation in methods.values():
                operation["security"] = [] if is_public(path) else [{"session": []}]
        return document


class _CachedFiles(Mount):
    """Serves scripts and stylesheet. It stands first, since matching the many routes of the API costs more."""

    def __init__(self, files: PageFiles) -> None:
        super().__init__("/", files)
        self._files = files

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        held = scope["type"] == "http" and self._files.holds(scope["path"])
        return super().matches(scope) if held else (Match.NONE, {})


class _PageFiles(Mount):
    """Serves the page's files; it does not match the paths of the API, whose 404 is the API's own."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        return (Match.NONE, {}) if is_protected(scope["path"]) else super().matches(scope)


def create_app(app_state: AppState, origins: frozenset[str]) -> ASGIApp:
    """The application; `origins` are the exact permitted origins of the page.

    One robot is at `/`. Several are at `/robots/NAME/` each, and `/` has the routes for all of them.
    """
    if len(app_state.robots) == 1:
        (robot,) = app_state.robots.values()
        return robot_app(app_state, robot, origins)
    robots = {name: robot_app(app_state, robot, origins, path_of(name)) for name, robot in app_state.robots.items()}
    return RobotRouter(robots, _common_app(app_state, origins))


def robot_app(app_state: AppState, robot: RobotContext, origins: frozenset[str], path: str = "/") -> ASGIApp:
    """The application of one robot, at this path."""

    def log_dropped(session: Session, kind: str) -> None:
        robot.log.note(reasons.view_message_dropped(session.user, kind), session.client)

    def log_closed(session: Session, reason: Reason) -> None:
        robot.log.note(reasons.view_closed(session.user, reason), session.client)

    files = PageFiles(web := resource("web"))
    routers = (
        page_router(web, files),
        sign_in_router(app_state),
        commands_router(robot),
        state_router(robot),
        camera_router(robot),
        plant_router(robot),
        preview_router(robot),
        control_router(robot),
        page_socket_router(robot),
        viser_router(robot.scene.views, robot.teleop.may_move, robot.teleop.drag, log_dropped, log_closed),
    )
    return _application(routers, files, app_state, origins, robot.log.note, path)


def _common_app(app_state: AppState, origins: frozenset[str]) -> ASGIApp:
    """The routes for all robots together."""
    first = path_of(next(iter(app_state.robots)))
    files = PageFiles(web := resource("web"))
    routers = (page_router(web, files, first), sign_in_router(app_state), robots_router(app_state))
    return _application(routers, files, app_state, origins, app_state.note)


def _application(
    routers: Sequence[APIRouter],
    files: PageFiles,
    app_state: AppState,
    origins: frozenset[str],
    note: Callable[[Reason, str], None],
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
    app.cookie = app_state.cookie
    for router in routers:
        app.include_router(router)
    app.router.routes.insert(0, _CachedFiles(files))
    app.router.routes.append(_PageFiles("/", files, name="web"))
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(HTTPException, _http_error)
    return SecurityMiddleware(
        app,
        app_state.sessions,
        origins,
        app_state.cookie,
        app_state.max_body_bytes,
        on_refusal=lambda reason: note(reason, "a foreign page"),
    )


async def _validation_error(_: Request, error: Exception) -> JSONResponse:
    """Validation errors as text: each field with its error."""
    problems = error.errors() if isinstance(error, RequestValidationError) else []
    errors = [f"{'.'.join(str(part) for part in problem['loc'])}: {problem['msg']}" for problem in problems[:5]]
    return answer(Result(422, reasons.request_invalid("; ".join(errors)[:400])))


async def _http_error(request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, HTTPException):
        return answer(Result(500))
    if error.status_code == 400:
        # FastAPI's response to bytes that are not UTF-8.
        return answer(Result(422, reasons.body_unreadable()))
    words = str(error.detail)[:400]
    told = error.reason if isinstance(error, RefusedError) else reasons.http_error(error.status_code, words)
    response = answer(Result(error.status_code, told))
    response.headers.update(error.headers or {})
    if error.status_code == 405:
        # Starlette lists the methods of one route alone, and two may share a path.
        path = getattr(request.scope.get("route"), "path_format", "")
        response.headers["Allow"] = ", ".join(request.app.openapi()["paths"].get(path, {"get": None})).upper()
    return response
