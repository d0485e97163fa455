"""REST for what an operator asks of perception: another pruning rule, and points by hand."""

from fastapi import APIRouter, Response

from rolling_panda import plant_requests as ask
from server import requests as body
from server.desk import Desk
from server.operator_api import Caller, answer


def plant_router(desk: Desk) -> APIRouter:
    """What is asked of perception; each answer says what came of it."""
    router = APIRouter(prefix="/api", tags=["points"])

    @router.post("/rule")
    async def rule(session: Caller, request: body.Rule) -> Response:
        """Prune by these numbers from now on. Points of all that was seen change at once; accepted ones may go."""
        return answer(await desk.ask_perception(session, ask.SetRule(user=session.user, **request.model_dump())))

    @router.post("/points/by-hand")
    async def by_hand(session: Caller, request: body.Ray) -> Response:
        """Add a point where a line of sight meets a cane; `reason` is its name."""
        wanted = ask.AddPoint(user=session.user, origin=request.origin, direction=request.direction)
        return answer(await desk.ask_perception(session, wanted))

    @router.post("/points/by-hand-in-image")
    async def by_hand_in_image(session: Caller, request: body.Pixel) -> Response:
        """Add a point on the cane under a pixel of one of the newest camera images; `reason` is its name."""
        return answer(
            await desk.ask_perception(session, ask.AddPointInImage(user=session.user, **request.model_dump()))
        )

    return router
