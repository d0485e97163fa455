"""REST for control of the robot's motion: who holds it, and how it changes hands."""

import msgspec
from fastapi import APIRouter, Depends, Response

from rolling_panda import intents
from server import requests as body
from server.desk import Desk, Result
from server.operator_api import ANSWERS, Caller, answer, heard


def control_router(desk: Desk) -> APIRouter:
    """Everything under `/api/control`."""
    router = APIRouter(prefix="/api/control", tags=["control"], responses=ANSWERS, dependencies=[Depends(heard(desk))])

    @router.get("")
    async def control(session: Caller) -> Response:
        """Who holds control, who asks for it, and for how long the lease still lives; `client` is the caller's key."""
        received = desk.link.control.peek()
        if received is None:
            return answer(Result(503, False, "The controller has not said yet who holds control; ask again."))
        told = msgspec.to_builtins(received.message) | {"client": session.client}
        return Response(msgspec.json.encode(told), media_type="application/json")

    @router.post("/here")
    async def here(session: Caller) -> Response:
        """Say that the caller is there, which keeps control: a page does so while the 3-D view keeps it busy."""
        if not session.may_operate:
            return answer(Result(403, False, f"a {session.role} may look and stop, not operate"))
        return answer(Result(200, True, ""))

    @router.post("/take")
    async def take(session: Caller, request: body.TakeControl) -> Response:
        """Hold control. From somebody else only with `confirm`; the robot stops first, and they are told."""
        return answer(await desk.ask(session, intents.TakeControl(user=session.user, confirmed=request.confirm)))

    @router.post("/request")
    async def request_it(session: Caller) -> Response:
        """Ask who holds control to grant it."""
        return answer(await desk.ask(session, intents.RequestControl(user=session.user)))

    @router.post("/grant")
    async def grant(session: Caller) -> Response:
        """Give control to who has asked for it; the robot stops first."""
        return answer(await desk.ask(session, intents.GrantControl(user=session.user)))

    @router.post("/return")
    async def give_back(session: Caller) -> Response:
        """Give control up; what moves is paused."""
        return answer(await desk.ask(session, intents.ReturnControl(user=session.user)))

    return router
