"""Several robots of one server: each has its application under its own path; here are the list and the stop of all."""

import asyncio
from collections.abc import Mapping

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from rolling_panda import reasons
from server.api import bodies as body
from server.api.dependencies import Caller
from server.api.responses import COMMAND, SIGNED_IN, STOP_BODY, RefusedError, answer
from server.auth.sessions import Session
from server.robots.app_state import AppState
from server.robots.context import RobotContext
from server.robots.link import Result
from server.robots.summary import RobotSummary, summarize

#: Each robot's page and REST interface are below it.
ROBOTS = "/robots"


def path_of(name: str) -> str:
    """Path of a robot's page."""
    return f"{ROBOTS}/{name}/"


def robots_router(app_state: AppState) -> APIRouter:
    """Routes that belong to no single robot, where there are several."""
    router = APIRouter()

    @router.get("/api/robots", tags=["robots"], responses=SIGNED_IN)
    async def robots(session: Caller) -> list[RobotSummary]:
        """A summary of every robot. The request counts neither as presence nor as a view of a robot."""
        return [
            summarize(name, path_of(name), robot.pages.state, robot.pages.points, session.client)
            for name, robot in app_state.robots.items()
        ]

    @router.post("/api/stop", tags=["robots"], responses=COMMAND, openapi_extra=STOP_BODY)
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop of every robot, by every role; 503 = the bridge of one did not confirm, `reason` says whose.

        A missing or unreadable body does not prevent the stop.
        """
        return answer(await stop_all(app_state.robots, session, body.Stop.read(await request.body())))

    @router.get(f"{ROBOTS}/{{name}}", include_in_schema=False)
    async def robot(name: str) -> Response:
        if name not in app_state.robots:
            raise unknown(name, app_state)
        return RedirectResponse(path_of(name))

    @router.api_route(f"{ROBOTS}/{{name}}/{{rest:path}}", methods=["GET", "HEAD", "POST"], include_in_schema=False)
    async def not_found(name: str) -> Response:
        raise unknown(name, app_state)

    return router


async def stop_all(robots: dict[str, RobotContext], session: Session, stop: body.Stop) -> Result:
    """Stop every robot at once; the status is the worst, the reason names the robots that have not confirmed."""
    commands = [robot.commands for robot in robots.values()]
    results = await asyncio.gather(*(each.stop(session, stop.reason, stop.press) for each in commands))
    by_code: dict[str, list[str]] = {}
    for name, result in zip(robots, results, strict=True):
        by_code.setdefault("" if result.reason is None else result.reason.code, []).append(name)
    for code, status, told in (
        ("stop_unconfirmed", 503, reasons.stop_of_all_unconfirmed),
        ("stop_half_confirmed", 200, reasons.stop_of_all_half_confirmed),
    ):
        if code in by_code:
            return Result(status, told(", ".join(by_code[code])))
    return Result(200, reasons.stop_of_all_confirmed(", ".join(robots)))


def unknown(name: str, app_state: AppState) -> RefusedError:
    """The error for a name that no robot has."""
    return RefusedError(404, reasons.robot_unknown(name[:64], ", ".join(app_state.robots)))


class RobotRouter:
    """ASGI application that dispatches each request to its robot's application, or to the one for all robots.

    A robot's application is given the path without its prefix, as if it were alone. So middleware, routes and the
    filter of the 3-D view are the same for one robot and for several, and none of them can reach another robot.
    """

    def __init__(self, robots: Mapping[str, ASGIApp], common: ASGIApp) -> None:
        """Serve `robots` by name, and every other path by `common`."""
        self._robots = {path_of(name): app for name, app in robots.items()}
        self._common = common

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Dispatch a request."""
        if scope["type"] in ("http", "websocket"):
            path: str = scope["path"]
            for prefix, app in self._robots.items():
                if path.startswith(prefix):
                    await app({**scope, "path": path[len(prefix) - 1 :]}, receive, send)
                    return
        await self._common(scope, receive, send)
