"""REST for control of the robot's motion: who holds it, and how it changes hands."""

import msgspec
from fastapi import APIRouter, Depends, Response

from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import ClientKey, ControlState
from server.api import bodies as body
from server.api.answers import ANSWERS, NOT_YET, Caller, Operator, answer, gives, heard, message
from server.robots.context import Result, RobotContext


class Control(ControlState, frozen=True, kw_only=True, tag="ControlState"):
    """What the controller says of control, with the key of who asks."""

    client: ClientKey


def control_router(desk: RobotContext) -> APIRouter:
    """Everything under `/api/control`."""
    router = APIRouter(prefix="/api/control", tags=["control"], dependencies=[Depends(heard(desk))])

    @router.get("", responses=gives(Control, NOT_YET))
    async def control(session: Caller) -> Response:
        """Who holds control, who asks for it, and for how long the lease still lives; `client` is the caller's key."""
        received = desk.link.control.peek()
        if received is None:
            return answer(Result(503, False, "The controller has not said yet who holds control; ask again."))
        return message(Control(**msgspec.structs.asdict(received.message), client=session.client))

    @router.post("/here", responses=ANSWERS)
    async def here(session: Operator) -> Response:
        """Say that the caller is there, which keeps control: a page does so while the 3-D view keeps it busy."""
        return answer(Result(200, True, ""))

    @router.post("/take", responses=ANSWERS)
    async def take(session: Operator, request: body.TakeControl) -> Response:
        """Hold control. From somebody else only with `confirm`; the robot stops first, and they are told."""
        return answer(await desk.ask(session, intents.TakeControl(user=session.user, confirmed=request.confirm)))

    @router.post("/request", responses=ANSWERS)
    async def request_it(session: Operator) -> Response:
        """Ask who holds control to grant it."""
        return answer(await desk.ask(session, intents.RequestControl(user=session.user)))

    @router.post("/grant", responses=ANSWERS)
    async def grant(session: Operator) -> Response:
        """Give control to who has asked for it; the robot stops first."""
        return answer(await desk.ask(session, intents.GrantControl(user=session.user)))

    @router.post("/return", responses=ANSWERS)
    async def give_back(session: Operator) -> Response:
        """Give control up; what moves is paused."""
        return answer(await desk.ask(session, intents.ReturnControl(user=session.user)))

    return router
