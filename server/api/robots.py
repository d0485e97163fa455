"""REST for all robots of the server together: which there are, and one stop for all of them."""

import asyncio

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import RedirectResponse

from server.api import bodies as body
from server.api.answers import ANSWERS, SIGNED_IN, STOP_BODY, Caller, answer
from server.auth.sessions import Session
from server.robots.app_state import AppState
from server.robots.context import Result, RobotContext
from server.robots.summary import Glance, glance

#: Below it each robot has a page and an interface of its own.
ROBOTS = "/robots"


def path_of(name: str) -> str:
    """Path of a robot's page."""
    return f"{ROBOTS}/{name}/"


def robots_router(reception: AppState) -> APIRouter:
    """Routes that belong to no single robot, where there are several."""
    router = APIRouter()

    @router.get("/api/robots", tags=["robots"], responses=SIGNED_IN)
    async def robots(session: Caller) -> list[Glance]:
        """Every robot at a glance. Asking is not looking: it keeps nobody's control, and no work going."""
        return [
            glance(name, path_of(name), desk.state, desk.points, session.client)
            for name, desk in reception.desks.items()
        ]

    @router.post("/api/stop", tags=["robots"], responses=ANSWERS, openapi_extra=STOP_BODY)
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop of every robot, by every role; 503 = the bridge of one did not confirm, `reason` says whose.

        Without a body, or with one that cannot be read, it stops all the same.
        """
        reason = body.Stop.read(await request.body()).reason
        return answer(await stop_all(reception.desks, session, reason))

    @router.get(f"{ROBOTS}/{{name}}", include_in_schema=False)
    async def robot(name: str) -> Response:
        if name not in reception.desks:
            raise unknown(name, reception)
        return RedirectResponse(path_of(name))

    @router.api_route(f"{ROBOTS}/{{name}}/{{rest:path}}", methods=["GET", "HEAD", "POST"], include_in_schema=False)
    async def nowhere(name: str) -> Response:
        raise unknown(name, reception)

    return router


async def stop_all(desks: dict[str, RobotContext], session: Session, reason: str) -> Result:
    """Stop every robot at the same time; as bad as the worst of them, in the words of each."""
    results = await asyncio.gather(*(desk.stop(session, reason) for desk in desks.values()))
    words = "; ".join(f"{name}: {result.reason}" for name, result in zip(desks, results, strict=True))
    return Result(max(result.status for result in results), all(result.ok for result in results), words)


def unknown(name: str, reception: AppState) -> HTTPException:
    """There is no such robot."""
    there = ", ".join(reception.desks)
    return HTTPException(404, f"there is no robot {name[:64]!r} here; there are: {there} (GET /api/robots)")
