"""Commands over REST: everything that an operator can do, so that a script can operate the robot.

A script signs in as a page does: `POST /api/sign-in` with a single-use token, keep the cookie, and send an `Origin`
header with the server's own address on every POST. `POST /api/invite` makes the token of another session.
"""

import time

from fastapi import APIRouter, Depends, Request, Response

from rolling_panda import messages as m
from rolling_panda.errors import ServiceError
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import BaseVelocity
from server.api import bodies as body
from server.api.dependencies import Caller, Operator, PointId, Supervisor, activity
from server.api.responses import COMMAND, STOP_BODY, TOO_MANY, answer
from server.auth.sessions import Session
from server.robots.context import MOTION_RATE_HZ, Result, RobotContext
from server.robots.teleop import TeleopCommand


def commands_router(robot: RobotContext) -> APIRouter:
    """Decisions on points, modes, teleoperation and replay."""
    router = APIRouter(prefix="/api", dependencies=[Depends(activity(robot))])

    async def ask(session: Session, intent: intents.Intent) -> Response:
        return answer(await robot.ask(session, intent))

    @router.post("/points/accept-all", tags=["points"], responses=COMMAND)
    async def accept_all(session: Operator, request: body.AcceptAll) -> Response:
        """Accept every proposed point with at least this confidence."""
        return await ask(session, intents.AcceptAll(user=session.user, confidence=request.confidence))

    @router.post("/points/{point_id}/accept", tags=["points"], responses=COMMAND)
    async def accept(session: Operator, point_id: PointId, request: body.AcceptPoint) -> Response:
        """Accept a point as it was seen: with the revision that `GET /api/points` showed."""
        accepted = request.model_dump()
        return await ask(session, intents.AcceptPoint(user=session.user, point_id=point_id, **accepted))

    @router.post("/points/{point_id}/reject", tags=["points"], responses=COMMAND)
    async def reject(session: Operator, point_id: PointId, request: body.RejectPoint) -> Response:
        """Take a point off the queue."""
        return await ask(session, intents.RejectPoint(user=session.user, point_id=point_id, reason=request.reason))

    @router.post("/points/{point_id}/reconsider", tags=["points"], responses=COMMAND)
    async def reconsider(session: Operator, point_id: PointId) -> Response:
        """Take back what was decided: an accepted or rejected point is proposed again."""
        return await ask(session, intents.ReconsiderPoint(user=session.user, point_id=point_id))

    @router.post("/points/{point_id}/resolve", tags=["points"], responses=COMMAND)
    async def resolve(session: Operator, point_id: PointId, request: body.ResolvePoint) -> Response:
        """Say how an UNKNOWN cut ended, after looking; it is never cut again by itself."""
        return await ask(session, intents.ResolvePoint(user=session.user, point_id=point_id, **request.model_dump()))

    @router.post("/points/{point_id}/work-before", tags=["points"], responses=COMMAND)
    async def work_before(session: Operator, point_id: PointId, request: body.MoveInQueue) -> Response:
        """Work on an accepted point before another one, or last."""
        wanted = intents.MoveInQueue(user=session.user, point_id=point_id, **request.model_dump())
        return await ask(session, wanted)

    @router.post("/points/{point_id}/approach", tags=["points"], responses=COMMAND)
    async def approach(session: Operator, point_id: PointId, request: body.SetApproach) -> Response:
        """Turn the approach to a point about its cane; an accepted one is planned anew, which says what comes of it."""
        wanted = intents.SetApproach(user=session.user, point_id=point_id, azimuth=request.azimuth)
        return await ask(session, wanted)

    @router.post("/order/planners", tags=["points"], responses=COMMAND)
    async def planners(session: Operator, request: body.ResetOrder) -> Response:
        """Work in the plan's order again."""
        return await ask(session, intents.ResetOrder(user=session.user, revision=request.revision))

    @router.post("/arm", tags=["mode"], responses=COMMAND)
    async def arm(session: Operator) -> Response:
        """IDLE to READY."""
        return await ask(session, intents.Arm(user=session.user))

    @router.post("/start", tags=["mode"], responses=COMMAND)
    async def start(session: Operator) -> Response:
        """Start automatic work on the accepted points."""
        return await ask(session, intents.Start(user=session.user))

    @router.post("/survey", tags=["mode"], responses=COMMAND)
    async def survey(session: Operator, request: body.Survey) -> Response:
        """Drive along the row with the camera on the vines; cuts nothing. Ends with what was found."""
        return await ask(session, intents.Survey(user=session.user, distance=request.distance))

    @router.post("/look-again", tags=["mode"], responses=COMMAND)
    async def look_again(session: Operator, request: body.Place) -> Response:
        """Drive to a site without a decision and take images from both sides; cuts nothing."""
        return await ask(session, intents.Survey(user=session.user, vine=request.vine, spur=request.spur))

    @router.post("/pause", tags=["mode"], responses=COMMAND)
    async def pause(session: Operator) -> Response:
        """Pause; nothing resumes by itself."""
        return await ask(session, intents.Pause(user=session.user))

    @router.post("/resume", tags=["mode"], responses=COMMAND)
    async def resume(session: Operator) -> Response:
        """PAUSED to READY; starting again is separate."""
        return await ask(session, intents.Resume(user=session.user))

    @router.post("/home", tags=["mode"], responses=COMMAND)
    async def home(session: Operator) -> Response:
        """Bring the arm back to its survey posture."""
        return await ask(session, intents.Home(user=session.user))

    @router.post("/acknowledge", tags=["mode"], responses=COMMAND)
    async def acknowledge(session: Operator) -> Response:
        """Acknowledge a protective stop or a fault whose cause has gone."""
        return await ask(session, intents.Acknowledge(user=session.user))

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
            result = await robot.link.seek(intents.SeekReplay(position_s=request.position_s, playing=request.playing))
        except ServiceError as error:
            return answer(Result(503, False, str(error)))
        return answer(Result(200, result.ok, result.reason))

    return router
