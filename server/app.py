"""The application: routes, error answers and the guard around them."""

from typing import Any

import msgspec
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.routing import Match, Mount
from starlette.types import ASGIApp, Scope

from rolling_panda import __version__
from rolling_panda.page_messages import PageEvents, PagePoints, PageState
from rolling_panda.plan_messages import SessionPlan
from rolling_panda.resources import resource
from server.control_api import control_router
from server.desk import Desk, Result
from server.guard import Guard, is_protected
from server.operator_api import answer, operator_router
from server.order_api import order_router
from server.page_files import PageFiles
from server.pages import pages_router
from server.plant_api import plant_router
from server.preview_api import preview_router
from server.replay_api import replay_router
from server.report_api import report_router
from server.robot_api import robot_router
from server.sessions import Session
from server.site import site_router
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


def create_app(desk: Desk, origins: frozenset[str]) -> ASGIApp:
    """The guarded application; `origins` are the exact origins that the page may have."""
    web = resource("web")
    app = _Application(
        title="Rolling Panda",
        version=__version__,
        description=_ABOUT,
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )

    def dropped(session: Session, kind: str) -> None:
        desk.note("warning", f"a view of {session.user} sent {kind!r} to the 3-D view; dropped", session.client)

    app.include_router(site_router(desk, web))
    app.include_router(operator_router(desk))
    app.include_router(plant_router(desk))
    app.include_router(order_router(desk))
    app.include_router(preview_router(desk))
    app.include_router(control_router(desk))
    app.include_router(robot_router(desk))
    app.include_router(replay_router(desk))
    app.include_router(report_router(desk))
    app.include_router(pages_router(desk))
    app.include_router(viser_router(desk.scene, desk.may_move, dropped))
    app.router.routes.append(_PageFiles("/", PageFiles(web), name="web"))
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _failed)
    return Guard(
        app,
        desk.sessions,
        origins,
        desk.cookie,
        desk.config.max_body_bytes,
        on_refusal=lambda text: desk.note("warning", text, "a foreign page"),
    )


async def _invalid(_: Request, error: Exception) -> JSONResponse:
    """Validation errors in words: which field, what is wrong."""
    problems = error.errors() if isinstance(error, RequestValidationError) else []
    words = [f"{'.'.join(str(part) for part in problem['loc'])}: {problem['msg']}" for problem in problems[:5]]
    return answer(Result(422, False, "; ".join(words)[:500] or "the request is wrong"))


async def _failed(_: Request, error: Exception) -> JSONResponse:
    status = error.status_code if isinstance(error, HTTPException) else 500
    return answer(Result(status, False, str(getattr(error, "detail", ""))[:500]))
