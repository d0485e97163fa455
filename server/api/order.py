"""REST for how accepted points are worked off: in which order, and approached from where."""

from fastapi import APIRouter, Response

from rolling_panda.messages import commands as intents
from server.api import bodies as body
from server.api.answers import ANSWERS, Operator, PointId, answer
from server.robots.context import RobotContext


def order_router(desk: RobotContext) -> APIRouter:
    """Both ways to change the order; `order` in the controller's state says whose it is, and its revision."""
    router = APIRouter(prefix="/api", tags=["points"], responses=ANSWERS)

    @router.post("/points/{point_id}/work-before")
    async def work_before(session: Operator, point_id: PointId, request: body.MoveInQueue) -> Response:
        """Work on an accepted point before another one, or last."""
        wanted = intents.MoveInQueue(user=session.user, point_id=point_id, **request.model_dump())
        return answer(await desk.ask(session, wanted))

    @router.post("/points/{point_id}/approach")
    async def approach(session: Operator, point_id: PointId, request: body.TurnApproach) -> Response:
        """Turn the approach to a point about its cane; an accepted one is planned anew, which says what comes of it."""
        wanted = intents.TurnApproach(user=session.user, point_id=point_id, azimuth=request.azimuth)
        return answer(await desk.ask(session, wanted))

    @router.post("/order/planners")
    async def planners(session: Operator, request: body.PlannersOrder) -> Response:
        """Work in the plan's order again."""
        return answer(await desk.ask(session, intents.PlannersOrder(user=session.user, revision=request.revision)))

    return router
