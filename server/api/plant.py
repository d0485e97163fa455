"""REST for what an operator asks of perception: another pruning rule, what one would change, and points by hand."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse

from rolling_panda.messages import commands as ask
from rolling_panda.messages.page import PagePoints
from rolling_panda.messages.perception import PruningRule
from rolling_panda.messages.types import RuleEffect
from server.api import bodies as body
from server.api.answers import ABSENT, ANSWERS, WRONG, Caller, Operator, PointId, answer, gives
from server.robots.context import Result, RobotContext


def plant_router(desk: RobotContext) -> APIRouter:
    """What is asked of perception; each answer says what came of it."""
    router = APIRouter(prefix="/api", tags=["points"])

    @router.post("/rule", responses=ANSWERS)
    async def rule(session: Operator, request: body.Rule) -> Response:
        """Prune by these numbers from now on. Points of all that was seen change at once; accepted ones may go."""
        wanted = ask.SetRule(user=session.user, rule=PruningRule(**request.model_dump()))
        return answer(await desk.ask_perception(session, wanted))

    @router.post("/rule/what-if", responses=ANSWERS | {200: {"model": body.RuleOutcome}})
    async def what_if(session: Operator, request: body.Rule) -> Response:
        """What these numbers would change; nothing does. `voided` counts the acceptances that would be void."""
        wanted = ask.TryRule(user=session.user, rule=PruningRule(**request.model_dump()))
        result = await desk.ask_perception(session, wanted)
        if not result.ok or result.effect is None:
            return answer(result)
        return JSONResponse(rule_outcome(result.effect, desk.points).model_dump())

    @router.post("/rule/undo", responses=ANSWERS)
    async def take_back(session: Operator, request: body.Rule) -> Response:
        """Take the rule that is in force back: the points and acceptances are again as before it.

        The numbers are those of that rule as it was seen: one that somebody has changed since is refused. What was cut,
        decided or placed by hand meanwhile stays so.
        """
        rule = PruningRule(**request.model_dump())
        done = await desk.ask_perception(session, ask.TakeRuleBack(user=session.user, rule=rule))
        if not done.ok:
            return answer(done)
        restored = await desk.ask(session, ask.RestoreAccepted(user=session.user, rule=rule))
        if not restored.ok:
            return answer(replace(restored, reason=f"the rule is back, its acceptances are not: {restored.reason}"))
        return answer(done)

    @router.post("/points/by-hand", responses=ANSWERS)
    async def by_hand(session: Operator, request: body.Ray) -> Response:
        """Add a point where a line of sight meets a cane; `reason` is its name."""
        wanted = ask.AddPoint(user=session.user, origin=request.origin, direction=request.direction)
        return answer(await desk.ask_perception(session, wanted))

    @router.post("/points/by-hand-in-image", responses=ANSWERS)
    async def by_hand_in_image(session: Operator, request: body.Pixel) -> Response:
        """Add a point on the cane under a pixel of one of the newest camera images; `reason` is its name."""
        return answer(
            await desk.ask_perception(session, ask.AddPointInImage(user=session.user, **request.model_dump()))
        )

    @router.post("/points/{point_id}/move", responses=ANSWERS)
    async def move(session: Operator, point_id: PointId, request: body.Move) -> Response:
        """Move a point along its cane; `reason` says what it is now. An acceptance of it may be void then."""
        wanted = ask.MovePoint(user=session.user, point_id=point_id, along=request.along)
        return answer(await desk.ask_perception(session, wanted))

    @router.get(
        "/points/{point_id}/crop",
        response_class=Response,
        responses=gives("image/jpeg", {204: {"description": "No picture has come yet: ask again."}}, ABSENT, WRONG),
    )
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


def rule_outcome(effect: RuleEffect, points: PagePoints | None) -> body.RuleOutcome:
    """What a rule would change, with the acceptances that it would make void, in numbers and in words."""
    rows = () if points is None else points.points
    accepted = {row.point.point_id for row in rows if row.entry.state in ("ACCEPTED", "UNREACHABLE")}
    voided = len(accepted & {*effect.moved, *effect.gone})
    moved, gone, added = len(effect.moved), len(effect.gone), effect.added
    parts = [f"{moved} {'moves' if moved == 1 else 'move'}"] if moved else []
    parts += [f"{gone} {'goes' if gone == 1 else 'go'}"] if gone else []
    parts += [f"{added} {'comes' if added == 1 else 'come'}"] if added else []
    parts += [f"{voided} {'acceptance' if voided == 1 else 'acceptances'} would be void"] if voided else []
    reason = ", ".join(parts) or "nothing would change"
    return body.RuleOutcome(ok=True, reason=reason, moved=moved, gone=gone, added=added, voided=voided)
