"""REST for what an operator asks of perception: another pruning rule, and points by hand."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from rolling_panda import plant_requests as ask
from rolling_panda.messages import PruningRule
from server import requests as body
from server.desk import Desk, Result
from server.operator_api import Caller, PointId, answer


def plant_router(desk: Desk) -> APIRouter:
    """What is asked of perception; each answer says what came of it."""
    router = APIRouter(prefix="/api", tags=["points"])

    @router.post("/rule")
    async def rule(session: Caller, request: body.Rule) -> Response:
        """Prune by these numbers from now on. Points of all that was seen change at once; accepted ones may go."""
        wanted = ask.SetRule(user=session.user, rule=PruningRule(**request.model_dump()))
        return answer(await desk.ask_perception(session, wanted))

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

    @router.post("/points/{point_id}/move")
    async def move(session: Caller, point_id: PointId, request: body.Move) -> Response:
        """Move a point along its cane; `reason` says what it is now. An acceptance of it may be void then."""
        wanted = ask.MovePoint(user=session.user, point_id=point_id, along=request.along)
        return answer(await desk.ask_perception(session, wanted))

    @router.get("/points/{point_id}/crop", response_class=Response)
    async def crop(session: Caller, point_id: PointId, revision: Annotated[int, Query(ge=0)] | None = None) -> Response:
        """What the camera saw around a point, the cut in the middle, as JPEG; of one revision where that is said.

        204 while no picture of a known point has come: ask again.
        """
        found = desk.link.crops.get(point_id)
        if found is None or revision not in (None, found.revision):
            known = desk.points.points if desk.points is not None else ()
            if any(row.point.point_id == point_id for row in known):
                # Nothing is wrong yet, and a browser's console should not say so.
                return Response(status_code=204)
            return answer(Result(404, False, f"there is no point {point_id!r}"))
        return Response(found.jpeg, media_type="image/jpeg")

    return router
