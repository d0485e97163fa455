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
from rolling_panda.messages import Severity
from rolling_panda.page_messages import PageEvents, PagePoints, PageState
from rolling_panda.plan_messages import SessionPlan
from rolling_panda.resources import resource
from server.camera_api import camera_router
from server.control_api import control_router
from server.desk import Desk, Result
from server.front import Front
from server.guard import Guard, is_protected
from server.operator_api import answer, operator_router
from server.order_api import order_router
from server.page_files import PageFiles
from server.pages import pages_router
from server.plant_api import plant_router
from server.preview_api import preview_router
from server.reception import Reception
from server.replay_api import replay_router
from server.report_api import report_router
from server.robot_api import robot_router
from server.robots_api import path_of, robots_router
from server.sessions import Session
from server.site import page_router, site_router
from server.viser_proxy import viser_router

_ABOUT = (
    "Everything that the page can do. Sign in with `POST /api/sign-in` and the token of a sign-in link, keep the "
    "cookie, and send an `Origin` header with the server's own address on every POST. A link signs in once; "
    "`POST /api/invite` makes another one for a script. Requests without fields do not read their body. "
    "Units are SI; frames follow REP-105."
)


class _Application(FastAPI):
    """Describes the page's own messages too, which FastAPI does not know."""

    def openapi(self) -> dict[str, Any]:
        document = super().openapi()
        _, messages = msgspec.json.schema_components(
            (PageState, PagePoints, PageEvents, SessionPlan), ref_template="#/components/schemas/{name}"
        )
        document.setdefault("components", {}).setdefault("schemas", {}).update(messages)
        return document


class _PageFiles(Mount):
    """The page's files. Under the paths of the API there are none, so what is asked there is not theirs to refuse."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        return (Match.NONE, {}) if is_protected(scope["path"]) else super().matches(scope)


def create_app(reception: Reception, origins: frozenset[str]) -> ASGIApp:
    """The guarded application; `origins` are the exact origins that the page may have.

    One robot is at `/`. Several are at `/robots/NAME/` each, and `/` has what is about all of them.
    """
    if len(reception.desks) == 1:
        (desk,) = reception.desks.values()
        return robot_app(reception, desk, origins)
    robots = {name: robot_app(reception, desk, origins) for name, desk in reception.desks.items()}
    return Front(robots, _hall(reception, origins))


def robot_app(reception: Reception, desk: Desk, origins: frozenset[str]) -> ASGIApp:
    """Everything about one robot."""

    def dropped(session: Session, kind: str) -> None:
        desk.note("warning", f"a view of {session.user} sent {kind!r} to the 3-D view; dropped", session.client)

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
        viser_router(desk.scene, desk.may_move, desk.dragged, dropped),
    )
    return _guarded(routers, files, reception, origins, desk.note)


def _hall(reception: Reception, origins: frozenset[str]) -> ASGIApp:
    """What several robots have in common."""
    first = path_of(next(iter(reception.desks)))
    files = PageFiles(web := resource("web"))
    routers = (page_router(web, files, first), site_router(reception), robots_router(reception))
    return _guarded(routers, files, reception, origins, reception.note)


def _guarded(
    routers: Sequence[APIRouter],
    files: PageFiles,
    reception: Reception,
    origins: frozenset[str],
    note: Callable[[Severity, str, str], None],
) -> ASGIApp:
    app = _Application(
        title="Rolling Panda",
        version=__version__,
        description=_ABOUT,
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
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


async def _failed(_: Request, error: Exception) -> JSONResponse:
    status = error.status_code if isinstance(error, HTTPException) else 500
    return answer(Result(status, False, str(getattr(error, "detail", ""))[:500]))
