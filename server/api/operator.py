"""REST for everything an operator can do, so that a script can be the operator.

A script signs in as a page does: `POST /api/sign-in` with a single-use token, keep the cookie, and send an `Origin`
header with the server's own address on every POST. `POST /api/invite` makes the token of another one.
"""

import time
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import JSONResponse

from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.messages import commands as intents
from rolling_panda.messages.page import PageEvents, PagePoints, PageState
from rolling_panda.messages.supervision import BaseVelocity, SessionPlan
from server.api import bodies as body
from server.api.answers import (
    ANSWERS,
    NOT_YET,
    STOP_BODY,
    TOO_OFTEN,
    WRONG,
    Caller,
    Operator,
    PointId,
    Supervisor,
    answer,
    gives,
    heard,
    message,
)
from server.auth.sessions import Session
from server.robots.context import Result, RobotContext
from server.robots.page_view import addressed
from server.robots.teleop import Aim


def operator_router(desk: RobotContext) -> APIRouter:
    """Everything under `/api` that needs a session."""
    router = APIRouter(prefix="/api", dependencies=[Depends(heard(desk))])

    async def ask(session: Session, intent: intents.Intent) -> JSONResponse:
        return answer(await desk.ask(session, intent))

    @router.post("/points/accept-all", tags=["points"], responses=ANSWERS)
    async def accept_all(session: Operator, request: body.AcceptAll) -> Response:
        """Accept every proposed point with at least this confidence."""
        return await ask(session, intents.AcceptAll(user=session.user, confidence=request.confidence))

    @router.post("/points/{point_id}/accept", tags=["points"], responses=ANSWERS)
    async def accept(session: Operator, point_id: PointId, request: body.AcceptPoint) -> Response:
        """Accept a point as it was seen: with the revision that `GET /api/points` showed."""
        accepted = request.model_dump()
        return await ask(session, intents.AcceptPoint(user=session.user, point_id=point_id, **accepted))

    @router.post("/points/{point_id}/reject", tags=["points"], responses=ANSWERS)
    async def reject(session: Operator, point_id: PointId, request: body.RejectPoint) -> Response:
        """Take a point off the queue."""
        return await ask(session, intents.RejectPoint(user=session.user, point_id=point_id, reason=request.reason))

    @router.post("/points/{point_id}/reconsider", tags=["points"], responses=ANSWERS)
    async def reconsider(session: Operator, point_id: PointId) -> Response:
        """Take back what was decided: an accepted or rejected point is proposed again."""
        return await ask(session, intents.ReconsiderPoint(user=session.user, point_id=point_id))

    @router.post("/points/{point_id}/resolve", tags=["points"], responses=ANSWERS)
    async def resolve(session: Operator, point_id: PointId, request: body.ResolvePoint) -> Response:
        """Say how an UNKNOWN cut ended, after looking; it is never cut again by itself."""
        return await ask(session, intents.ResolvePoint(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/arm", tags=["mode"], responses=ANSWERS)
    async def arm(session: Operator) -> Response:
        """IDLE to READY."""
        return await ask(session, intents.Arm(user=session.user))

    @router.post("/start", tags=["mode"], responses=ANSWERS)
    async def start(session: Operator) -> Response:
        """Start automatic work on the accepted points."""
        return await ask(session, intents.Start(user=session.user))

    @router.post("/survey", tags=["mode"], responses=ANSWERS)
    async def survey(session: Operator, request: body.Survey) -> Response:
        """Drive along the row with the camera on the vines; cuts nothing. Ends with what was found."""
        return await ask(session, intents.Survey(user=session.user, distance=request.distance))

    @router.post("/look-again", tags=["mode"], responses=ANSWERS)
    async def look_again(session: Operator, request: body.Place) -> Response:
        """Drive to a place that was left open and look at it from both its sides; cuts nothing."""
        return await ask(session, intents.Survey(user=session.user, vine=request.vine, spur=request.spur))

    @router.post("/pause", tags=["mode"], responses=ANSWERS)
    async def pause(session: Operator) -> Response:
        """Pause; nothing resumes by itself."""
        return await ask(session, intents.Pause(user=session.user))

    @router.post("/resume", tags=["mode"], responses=ANSWERS)
    async def resume(session: Operator) -> Response:
        """PAUSED to READY; starting again is separate."""
        return await ask(session, intents.Resume(user=session.user))

    @router.post("/home", tags=["mode"], responses=ANSWERS)
    async def home(session: Operator) -> Response:
        """Bring the arm back to its survey posture."""
        return await ask(session, intents.Home(user=session.user))

    @router.post("/acknowledge", tags=["mode"], responses=ANSWERS)
    async def acknowledge(session: Operator) -> Response:
        """Acknowledge a protective stop or a fault whose cause has gone."""
        return await ask(session, intents.Acknowledge(user=session.user))

    @router.post("/stop", tags=["mode"], responses=ANSWERS, openapi_extra=STOP_BODY)
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop, by every role. It goes straight to bridge and controller; 503 = the bridge did not confirm.

        `reason` says who has latched it. Without a body, or with one that cannot be read, it stops all the same.
        """
        return answer(await desk.stop(session, body.Stop.read(await request.body()).reason))

    @router.post("/reset", tags=["mode"], responses=ANSWERS)
    async def reset(session: Supervisor, request: body.Reset) -> Response:
        """Release the latched stop, with a reason; moves nothing. Supervisors only."""
        return await ask(session, intents.Reset(user=session.user, reason=request.reason, stop_id=request.stop_id))

    @router.post("/teleop", tags=["teleoperation"], responses=ANSWERS | TOO_OFTEN)
    async def teleop(session: Operator, request: body.Teleop) -> Response:
        """Hold the robot to a tool target (T_odom_tool), a base velocity or joint velocities for the next 150 ms.

        Repeat to keep holding. A hold that lapsed more than a second ago has to be let go of (`hold: false`) first.

        Only while the caller also fetches `GET /api/state` at least twice a second: who does not look may not move.
        """
        if not request.hold:
            desk.let_go(session)
            return answer(Result(200, True, "released"))
        if request.target is not None and request.target.refused:
            return answer(Result(409, False, request.target.refused))
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

    @router.get("/state", tags=["state"], responses=gives(PageState, NOT_YET))
    async def state(session: Caller) -> Response:
        """The newest state of the robot: what the page gets 10 times a second."""
        if desk.state is None:
            return answer(Result(503, False, "The server is starting; ask again."))
        desk.fetched(session, time.monotonic())
        return message(addressed(desk.state, session))

    @router.get("/points", tags=["state"], responses=gives(PagePoints))
    async def points(session: Caller) -> Response:
        """Every pruning point in the order of work, with its life in the queue."""
        return message(desk.points if desk.points is not None else desk.view.points(time.monotonic()))

    @router.get("/plan", tags=["state"], responses=gives(SessionPlan, NOT_YET))
    async def plan(session: Caller) -> Response:
        """The session's plan: order and way of each accepted point that can be cut, and why the others cannot."""
        received = desk.link.plan.peek()
        if received is None:
            return answer(Result(503, False, "The controller has not said its plan yet; ask again."))
        return message(received.message)

    @router.get("/events", tags=["state"], responses=gives(PageEvents, WRONG))
    async def events(session: Caller, after: Annotated[int, Query(ge=0)] = 0) -> Response:
        """Log lines after line number `after`, oldest first."""
        return message(PageEvents(events=desk.log.after(after, desk.config.log_lines)))

    return router
