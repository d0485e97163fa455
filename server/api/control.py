"""REST for control of the robot: who holds it."""

import msgspec
from fastapi import APIRouter, Depends, Response

from rolling_panda import reasons
from rolling_panda.messages.supervision import ClientKey, ControlState
from server.api.dependencies import Caller, Operator, activity
from server.api.responses import COMMAND, UNAVAILABLE, answer, message, query
from server.robots.commands import Result
from server.robots.context import RobotContext


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
