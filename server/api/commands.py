"""Commands over REST: everything that an operator can do, so that a script can operate the robot.

A script signs in as a page does: `POST /api/sign-in` with a single-use token, keep the cookie, and send an `Origin`
header with the server's own address on every POST. `POST /api/invite` makes the token of another session.
"""

import time
from collections.abc import Awaitable, Callable

from fastapi import APIRouter, Depends, Request, Response

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.errors import ServiceError
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import BaseVelocity
from server.api import bodies as body
from server.api.dependencies import Caller, Operator, PointId, Supervisor, activity
from server.api.responses import COMMAND, STOP_BODY, TOO_MANY, answer
from server.auth.sessions import Session
from server.robots.context import MOTION_RATE_HZ, Result, RobotContext
from server.robots.teleop import TeleopCommand

#: Commands without parameters: path, tag, intent, description.
_PLAIN: tuple[tuple[str, str, Callable[..., intents.Intent], str], ...] = (
    ("/arm", "mode", intents.Arm, "IDLE to READY."),
    ("/start", "mode", intents.Start, "Start automatic work on the accepted points."),
    ("/pause", "mode", intents.Pause, "Pause; nothing resumes by itself."),
    ("/resume", "mode", intents.Resume, "PAUSED to READY; starting again is separate."),
    ("/home", "mode", intents.Home, "Bring the arm back to its survey posture."),
    ("/acknowledge", "mode", intents.Acknowledge, "Acknowledge a protective stop or a fault whose cause has gone."),
    ("/control/request", "control", intents.RequestControl, "Request control from its holder."),
    ("/control/grant", "control", intents.GrantControl, "Grant control to who has requested it, after a stop."),
    ("/control/return", "control", intents.ReturnControl, "Return control; motion is paused."),
)


def commands_router(robot: RobotContext) -> APIRouter:
    """Decisions on points, modes, teleoperation and replay."""
    router = APIRouter(prefix="/api", dependencies=[Depends(activity(robot))])

    async def ask(session: Session, intent: intents.Intent) -> Response:
        return answer(await robot.ask(session, intent))

    def plain(intent: Callable[..., intents.Intent]) -> Callable[[Session], Awaitable[Response]]:
        async def command(session: Operator) -> Response:
            return await ask(session, intent(user=session.user))

        return command

    for path, tag, kind, about in _PLAIN:
        name = path.strip("/").replace("/", "_")
        router.post(path, name=name, tags=[tag], responses=COMMAND, description=about)(plain(kind))

    @router.post("/points/accept-all", tags=["points"], responses=COMMAND)
    async def accept_all(session: Operator, request: body.AcceptAll) -> Response:
        """Accept every proposed point with at least this confidence."""
        return await ask(session, intents.AcceptAll(user=session.user, confidence=request.confidence))

    @router.post("/points/{point_id}/accept", tags=["points"], responses=COMMAND)
    async def accept(session: Operator, point_id: PointId, request: body.AcceptPoint) -> Response:
        """Accept a point in the revision that `GET /api/points` showed."""
        return await ask(session, intents.AcceptPoint(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/points/{point_id}/reject", tags=["points"], responses=COMMAND)
    async def reject(session: Operator, point_id: PointId, request: body.RejectPoint) -> Response:
        """Remove a point from the queue."""
        return await ask(session, intents.RejectPoint(user=session.user, point_id=point_id, reason=request.reason))

    @router.post("/points/{point_id}/reconsider", tags=["points"], responses=COMMAND)
    async def reconsider(session: Operator, point_id: PointId) -> Response:
        """Undo a decision: an accepted or rejected point is proposed again."""
        return await ask(session, intents.ReconsiderPoint(user=session.user, point_id=point_id))

    @router.post("/points/{point_id}/resolve", tags=["points"], responses=COMMAND)
    async def resolve(session: Operator, point_id: PointId, request: body.ResolvePoint) -> Response:
        """Report how an UNKNOWN cut ended, after an inspection; it is never cut again automatically."""
        return await ask(session, intents.ResolvePoint(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/points/{point_id}/work-before", tags=["points"], responses=COMMAND)
    async def work_before(session: Operator, point_id: PointId, request: body.MoveInQueue) -> Response:
        """Work on an accepted point before another one, or last."""
        return await ask(session, intents.MoveInQueue(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/points/{point_id}/approach", tags=["points"], responses=COMMAND)
    async def approach(session: Operator, point_id: PointId, request: body.SetApproach) -> Response:
        """Set the angle of the approach about the cane; an accepted point is planned again."""
        return await ask(session, intents.SetApproach(user=session.user, point_id=point_id, azimuth=request.azimuth))

    @router.post("/order/planners", tags=["points"], responses=COMMAND)
    async def planners(session: Operator, request: body.ResetOrder) -> Response:
        """Restore the order of the plan."""
        return await ask(session, intents.ResetOrder(user=session.user, revision=request.revision))

    @router.post("/survey", tags=["mode"], responses=COMMAND)
    async def survey(session: Operator, request: body.Survey) -> Response:
        """Drive along the row with the camera on the vines; cuts nothing."""
        return await ask(session, intents.Survey(user=session.user, distance=request.distance))

    @router.post("/look-again", tags=["mode"], responses=COMMAND)
    async def look_again(session: Operator, request: body.Place) -> Response:
        """Drive to a site without a decision and take images from both sides; cuts nothing."""
        return await ask(session, intents.Survey(user=session.user, vine=request.vine, spur=request.spur))

    @router.post("/stop", tags=["mode"], responses=COMMAND, openapi_extra=STOP_BODY)
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop, by every role. It goes straight to bridge and controller; 503 = the bridge did not confirm.

        `reason` says which of them have latched it. A missing or unreadable body does not prevent the stop.
        """
        return answer(await robot.stop(session, body.Stop.read(await request.body()).reason))

    @router.post("/reset", tags=["mode"], responses=COMMAND)
    async def reset(session: Supervisor, request: body.Reset) -> Response:
        """Release the latched stop, with a reason; moves nothing. Supervisors only."""
        return await ask(session, intents.Reset(user=session.user, reason=request.reason, stop_id=request.stop_id))

    @router.post("/teleop", tags=["teleoperation"], responses=COMMAND | TOO_MANY)
    async def teleop(session: Operator, request: body.Teleop) -> Response:
        """Hold the robot to a tool target (T_odom_tool), a base velocity or joint velocities for the next 150 ms.

        Repeat to keep holding. A hold that lapsed more than a second ago has to be released (`hold: false`) first.

        The caller has to fetch `GET /api/state` at least twice a second: motion needs a current view of the robot.
        """
        if not request.hold:
            robot.release(session)
            return answer(Result(200, True, "released"))
        if request.target is not None and request.target.refused:
            return answer(Result(409, False, request.target.refused))
        if not robot.motion_limiter.take(session.session_id, time.monotonic()):
            limit = f"at most {MOTION_RATE_HZ:.0f} requests for motion a second; ask less often"
            return answer(Result(429, False, limit))
        command = TeleopCommand(
            None if request.target is None else m.Pose(request.target.position, request.target.quat_xyzw),
            None if request.base is None else BaseVelocity(request.base.linear, request.base.angular),
            request.joints,
        )
        if command != TeleopCommand():
            robot.teleop.set_command(session.session_id, command)
        return answer(robot.hold(session, time.monotonic(), speed_scale=request.speed_scale))

    @router.post("/replay", tags=["replay"], responses=COMMAND)
    async def seek(session: Caller, request: body.Seek) -> Response:
        """Seek, pause or play the recording; 409 while none is played."""
        if robot.link.replay.peek() is None:
            return answer(Result(409, False, "this is no recording but a robot"))
        try:
            result = await robot.link.call(
                topics.SEEK, intents.SeekReplay(position_s=request.position_s, playing=request.playing)
            )
        except ServiceError as error:
            return answer(Result(503, False, str(error)))
        return answer(Result(200, result.ok, result.reason))

    return router
