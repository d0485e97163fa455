"""REST for everything an operator can do, so that a script can be the operator.

A script signs in as a page does: `POST /api/sign-in` with a single-use token, keep the cookie, and send an `Origin`
header with the server's own address on every POST. `POST /api/invite` makes the token of another one.
"""

import time
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Depends, HTTPException, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel

from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.page_messages import PageEvents
from rolling_panda.teleop_messages import BaseVelocity
from server import requests as body
from server.desk import Desk, Result
from server.page_view import addressed
from server.sessions import Session
from server.teleop import Aim

PointId = Annotated[str, body.POINT_ID]


def _session(request: Request) -> Session:
    session: Session | None = request.state.session
    if session is None:
        raise HTTPException(401, "sign in first")
    return session


Caller = Annotated[Session, Depends(_session)]

#: How every request is answered.
ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"model": body.Outcome, "description": "Done."},
    401: {"model": body.Outcome, "description": "Not signed in."},
    403: {"model": body.Outcome, "description": "The role may not, or the Origin header is missing or foreign."},
    409: {"model": body.Outcome, "description": "Refused by the controller; `reason` says why."},
    422: {"model": body.Outcome, "description": "The request is wrong; `reason` names the field."},
    503: {"model": body.Outcome, "description": "The controller does not answer."},
}


def heard(desk: Desk) -> Callable[[Request], Awaitable[None]]:
    """What notes that somebody asks, which is how a script shows that it is there."""

    # Not a plain function, which would run on a thread of its own: who is there is for the server's loop alone.
    async def note(request: Request) -> None:
        session: Session | None = request.state.session
        if session is not None:
            desk.heard(session, time.monotonic())

    return note


def operator_router(desk: Desk) -> APIRouter:
    """Everything under `/api` that needs a session."""
    router = APIRouter(prefix="/api", responses=ANSWERS, dependencies=[Depends(heard(desk))])

    async def ask(session: Session, intent: intents.Intent) -> JSONResponse:
        return answer(await desk.ask(session, intent))

    @router.post("/points/accept-all", tags=["points"])
    async def accept_all(session: Caller, request: body.AcceptAll) -> Response:
        """Accept every proposed point with at least this confidence."""
        return await ask(session, intents.AcceptAll(user=session.user, confidence=request.confidence))

    @router.post("/points/{point_id}/accept", tags=["points"])
    async def accept(session: Caller, point_id: PointId, request: body.AcceptPoint) -> Response:
        """Accept a point as it was seen: with the revision that `GET /api/points` showed."""
        accepted = request.model_dump()
        return await ask(session, intents.AcceptPoint(user=session.user, point_id=point_id, **accepted))

    @router.post("/points/{point_id}/reject", tags=["points"])
    async def reject(session: Caller, point_id: PointId, request: body.RejectPoint) -> Response:
        """Take a point off the queue."""
        return await ask(session, intents.RejectPoint(user=session.user, point_id=point_id, reason=request.reason))

    @router.post("/points/{point_id}/reconsider", tags=["points"])
    async def reconsider(session: Caller, point_id: PointId) -> Response:
        """Take back what was decided: an accepted or rejected point is proposed again."""
        return await ask(session, intents.ReconsiderPoint(user=session.user, point_id=point_id))

    @router.post("/points/{point_id}/resolve", tags=["points"])
    async def resolve(session: Caller, point_id: PointId, request: body.ResolvePoint) -> Response:
        """Say how an UNKNOWN cut ended, after looking; it is never cut again by itself."""
        return await ask(session, intents.ResolvePoint(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/arm", tags=["mode"])
    async def arm(session: Caller) -> Response:
        """IDLE to READY."""
        return await ask(session, intents.Arm(user=session.user))

    @router.post("/start", tags=["mode"])
    async def start(session: Caller) -> Response:
        """Start automatic work on the accepted points."""
        return await ask(session, intents.Start(user=session.user))

    @router.post("/survey", tags=["mode"])
    async def survey(session: Caller, request: body.Survey) -> Response:
        """Drive along the row with the camera on the vines; cuts nothing. Ends with what was found."""
        return await ask(session, intents.Survey(user=session.user, distance=request.distance))

    @router.post("/look-again", tags=["mode"])
    async def look_again(session: Caller, request: body.Place) -> Response:
        """Drive to a place that was left open and look at it from both its sides; cuts nothing."""
        return await ask(session, intents.Survey(user=session.user, vine=request.vine, spur=request.spur))

    @router.post("/pause", tags=["mode"])
    async def pause(session: Caller) -> Response:
        """Pause; nothing resumes by itself."""
        return await ask(session, intents.Pause(user=session.user))

    @router.post("/resume", tags=["mode"])
    async def resume(session: Caller) -> Response:
        """PAUSED to READY; starting again is separate."""
        return await ask(session, intents.Resume(user=session.user))

    @router.post("/home", tags=["mode"])
    async def home(session: Caller) -> Response:
        """Bring the arm back to its survey posture."""
        return await ask(session, intents.Home(user=session.user))

    @router.post("/acknowledge", tags=["mode"])
    async def acknowledge(session: Caller) -> Response:
        """Acknowledge a protective stop or a fault whose cause has gone."""
        return await ask(session, intents.Acknowledge(user=session.user))

    @router.post("/stop", tags=["mode"], openapi_extra=_described(body.Stop))
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop, by every role. It goes straight to bridge and controller; 503 = the bridge did not confirm.

        `reason` says who has latched it. Without a body, or with one that cannot be read, it stops all the same.
        """
        return answer(await desk.stop(session, body.Stop.read(await request.body()).reason))

    @router.post("/reset", tags=["mode"])
    async def reset(session: Caller, request: body.Reset) -> Response:
        """Release the latched stop, with a reason; moves nothing. Supervisors only."""
        if session.role != "supervisor":
            return answer(Result(403, False, "only a supervisor may release a stop"))
        return await ask(session, intents.Reset(user=session.user, reason=request.reason, stop_id=request.stop_id))

    @router.post("/teleop", tags=["teleoperation"])
    async def teleop(session: Caller, request: body.Teleop) -> Response:
        """Hold the robot to a tool target (T_odom_tool), a base velocity or joint velocities for the next 150 ms.

        Repeat to keep holding. A hold that lapsed more than a second ago has to be let go of (`hold: false`) first.

        Only while the caller also fetches `GET /api/state` at least twice a second: who does not look may not move.
        """
        if not session.may_operate:
            return answer(Result(403, False, f"a {session.role} may look and stop, not operate"))
        if not request.hold:
            desk.let_go(session)
            return answer(Result(200, True, "released"))
        try:
            desk.motion.count(session.session_id, time.monotonic())
        except InputError as error:
            return answer(Result(429, False, str(error)))
        aim = Aim(
            None if request.target is None else m.Pose(request.target.position, request.target.quat_xyzw),
            None if request.base is None else BaseVelocity(request.base.linear, request.base.angular),
            request.joints,
        )
        if aim != Aim():
            desk.teleop.want(session.session_id, aim)
        return answer(desk.hold(session, time.monotonic(), share=request.share))

    @router.get("/state", tags=["state"], responses=_schema("PageState"))
    async def state(session: Caller) -> Response:
        """The newest state of the robot: what the page gets 10 times a second."""
        if desk.state is None:
            return answer(Result(503, False, "The server is starting; ask again."))
        desk.fetched(session, time.monotonic())
        return _json(addressed(desk.state, session))

    @router.get("/points", tags=["state"], responses=_schema("PagePoints"))
    async def points(session: Caller) -> Response:
        """Every pruning point in the order of work, with its life in the queue."""
        return _json(desk.points if desk.points is not None else desk.view.points(time.monotonic()))

    @router.get("/plan", tags=["state"], responses=_schema("SessionPlan"))
    async def plan(session: Caller) -> Response:
        """The session's plan: order and way of each accepted point that can be cut, and why the others cannot."""
        received = desk.link.plan.peek()
        if received is None:
            return answer(Result(503, False, "The controller has not said its plan yet; ask again."))
        return _json(received.message)

    @router.get("/events", tags=["state"], responses=_schema("PageEvents"))
    async def events(session: Caller, after: Annotated[int, Query(ge=0)] = 0) -> Response:
        """Log lines after line number `after`, oldest first."""
        return _json(PageEvents(events=desk.log.after(after, desk.config.log_lines)))

    return router


def answer(result: Result) -> JSONResponse:
    """A result as every request is answered: `{ok, reason}`."""
    return JSONResponse({"ok": result.ok, "reason": result.reason}, result.status)


def _json(message: msgspec.Struct) -> Response:
    return Response(msgspec.json.encode(message), media_type="application/json")


def _described(kind: type[BaseModel]) -> dict[str, Any]:
    """The body of a request that reads it by itself, for the description."""
    return {"requestBody": {"content": {"application/json": {"schema": kind.model_json_schema()}}}}


def _schema(name: str) -> dict[int | str, dict[str, Any]]:
    content = {"application/json": {"schema": {"$ref": f"#/components/schemas/{name}"}}}
    return {200: {"description": "Now.", "content": content, "model": None}}
