"""Commands over REST, and who has control: everything that an operator can do, so that a script can operate the robot.

A script signs in as a page does: `POST /api/sign-in` with a single-use token, keep the cookie, and send an `Origin`
header with the server's own address on every POST. `POST /api/invite` makes the token of another session.
"""

import re
import time
from collections.abc import Callable
from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.commands import COMMANDS, Command, PlantRequest, SeekReplay
from rolling_panda.errors import ServiceError
from rolling_panda.generate.description import describe
from rolling_panda.messages.supervision import BaseVelocity, ClientKey, ControlState
from server.api import bodies as body
from server.api.dependencies import Caller, Operator, activity, fields_of, operator, supervisor
from server.api.preview import outdated_preview
from server.api.responses import COMMAND, STOP_BODY, TOO_MANY, UNAVAILABLE, answer, message, query
from server.auth.sessions import Session
from server.robots.context import RobotContext
from server.robots.link import Result, result_of
from server.robots.teleop import MOTION_RATE_HZ, TeleopCommand

#: What the server itself refuses of a command, since it has newer data than the controller: the reason, or None.
_CHECKS: dict[type[msgspec.Struct], Callable[[RobotContext, Any], m.Reason | None]] = {
    intents.ApprovePreview: outdated_preview
}


def commands_router(robot: RobotContext) -> APIRouter:
    """The commands of the table, the software stop, teleoperation and replay."""
    router = APIRouter(prefix="/api", dependencies=[Depends(activity(robot))])
    for command in COMMANDS:
        if command.path:
            _add(router, robot, command)

    @router.post("/stop", tags=["mode"], responses=COMMAND, openapi_extra=STOP_BODY)
    async def stop(session: Caller, request: Request) -> Response:
        """Software stop, by every role. It goes straight to bridge and controller; 503 = the bridge did not confirm.

        `reason` says which of them have latched it. A missing or unreadable body does not prevent the stop.
        """
        told = body.Stop.read(await request.body())
        return answer(await robot.commands.stop(session, told.reason, told.press))

    @router.post("/teleop", tags=["teleoperation"], responses=COMMAND | TOO_MANY)
    async def teleop(session: Operator, request: body.Teleop) -> Response:
        """Hold the robot to a tool target (T_odom_tool), a base velocity or joint velocities for the next 150 ms.

        Repeat to keep holding. A hold that lapsed more than a second ago has to be released (`hold: false`) first.

        The caller has to fetch `GET /api/state` at least twice a second: motion needs a current view of the robot.
        """
        if not request.hold:
            robot.teleop.release(session)
            return answer(Result(200))
        if request.target is not None and request.target.refused is not None:
            return answer(Result(409, request.target.refused))
        now = time.monotonic()
        if not robot.teleop.within_rate(session, now):
            return answer(Result(429, reasons.motion_rate_exceeded(MOTION_RATE_HZ)))
        command = TeleopCommand(
            None if request.target is None else m.Pose(request.target.position, request.target.quat_xyzw),
            None if request.base is None else BaseVelocity(request.base.linear, request.base.angular),
            request.joints,
        )
        given = None if command == TeleopCommand() else command
        refused = robot.teleop.hold(session, now, given, speed_scale=request.speed_scale)
        return answer(Result(200) if refused is None else Result(409, refused))

    @router.post("/replay", tags=["replay"], responses=COMMAND)
    async def seek(session: Caller, wanted: Annotated[dict[str, Any], Depends(fields_of(SeekReplay))]) -> Response:
        """Seek, pause or play the recording; 409 while none is played."""
        if robot.link.replay.peek() is None:
            return answer(Result(409, reasons.no_recording()))
        try:
            result = await robot.link.call(topics.SEEK, SeekReplay(**wanted))
        except ServiceError as error:
            return answer(Result(503, reasons.service_silent("recorder", str(error))))
        return answer(result_of(result))

    return router


def _add(router: APIRouter, robot: RobotContext, command: Command) -> None:
    """Add the route of a command of the table."""
    in_path = re.findall(r"{(\w+)}", command.path)
    role = supervisor if command.role == "supervisor" else operator
    read = fields_of(command.message, in_path)
    check = _CHECKS.get(command.message)

    async def ask(
        session: Annotated[Session, Depends(role)], fields: Annotated[dict[str, Any], Depends(read)]
    ) -> Response:
        asked = command.message(user=session.user, **fields)
        refused = _not_now(robot, command) if check is None else check(robot, asked)
        if refused is not None:
            robot.log.note(reasons.request_refused(command.name, session.user, refused))
            return answer(Result(409, refused))
        if isinstance(asked, PlantRequest):
            return answer(await robot.commands.ask_perception(session, asked))
        return answer(await robot.commands.ask(session, asked))

    router.post(
        command.path,
        name=command.name,
        tags=[command.tag],
        responses=COMMAND,
        description=describe(command.message).about,
    )(ask)


def _not_now(robot: RobotContext, command: Command) -> m.Reason | None:
    """Why the controller does not allow a command of another process that depends on the mode; None if it does."""
    if command.process == "controller" or not command.modes:
        return None
    controller = robot.link.controller.peek()
    unknown = reasons.not_reported("controller")
    return unknown if controller is None else controller.message.allowed.get(command.name, unknown)


class Control(ControlState, frozen=True, kw_only=True, tag="ControlState"):
    """The state of control, with the caller's key."""

    client: ClientKey


def control_router(robot: RobotContext) -> APIRouter:
    """`/api/control`; its transfer is in the table of commands."""
    router = APIRouter(prefix="/api/control", tags=["control"], dependencies=[Depends(activity(robot))])

    @router.get("", responses=query(Control, UNAVAILABLE))
    async def control(session: Caller) -> Response:
        """Who holds control, who requests it, and the remaining time of the lease; `client` is the caller's key."""
        received = robot.link.control.peek()
        if received is None:
            return answer(Result(503, reasons.not_reported("controller")))
        return message(Control(**msgspec.structs.asdict(received.message), client=session.client))

    @router.post("/here", responses=COMMAND)
    async def here(session: Operator) -> Response:
        """Report presence, which renews the lease: a page does so while the 3-D view keeps it busy."""
        return answer(Result(200))

    return router
