"""REST for requests to perception about the pruning rule, and pictures of spurs."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.responses import JSONResponse

from rolling_panda import commands as ask
from rolling_panda import reasons
from rolling_panda.messages.page import PagePoints
from rolling_panda.messages.perception import PruningRule, SpurDrawing, SpurPicture
from rolling_panda.messages.types import RuleEffect
from server.api import bodies as body
from server.api.dependencies import Caller, Operator, PointId, fields_of
from server.api.responses import COMMAND, INVALID, NOT_FOUND, Responses, answer, message, outcome, query
from server.robots.context import RobotContext
from server.robots.link import Result


def _rule(fields: Annotated[dict[str, Any], Depends(fields_of(PruningRule))]) -> PruningRule:
    return PruningRule(**fields)


#: The pruning rule that a request's body describes.
RuleBody = Annotated[PruningRule, Depends(_rule)]
#: Number of a vine or a spur.
Number = Annotated[int, Path(ge=0, le=100000)]
#: Hash of a picture.
Image = Annotated[str | None, Query(max_length=64)]
_NOT_YET: Responses = {204: {"description": "No picture has come yet: ask again."}}
_PICTURE = query("image/jpeg", _NOT_YET, NOT_FOUND, INVALID)


def plant_router(robot: RobotContext) -> APIRouter:
    """Requests that perception answers."""
    router = APIRouter(prefix="/api", tags=["points"])

    @router.post("/rule", name="rule", responses=COMMAND)
    async def set_rule(session: Operator, rule: RuleBody) -> Response:
        """Set the pruning rule. All points change at once; accepted ones may be removed."""
        wanted = ask.SetRule(user=session.user, rule=rule)
        return answer(await robot.commands.ask_perception(session, wanted))

    @router.post("/rule/what-if", responses=COMMAND | {200: {"model": body.RuleOutcome}})
    async def what_if(session: Operator, rule: RuleBody) -> Response:
        """What a rule would change, without setting it. `voided` counts the acceptances that would become void."""
        wanted = ask.EvaluateRule(user=session.user, rule=rule)
        result = await robot.commands.ask_perception(session, wanted)
        if not result.ok or result.effect is None:
            return answer(result)
        return JSONResponse(rule_outcome(result.effect, robot.pages.points))

    @router.post("/rule/undo", responses=COMMAND)
    async def undo(session: Operator, rule: RuleBody) -> Response:
        """Undo the present rule: restore the points and acceptances from before it.

        The body has the rule that the caller saw; where it has changed since, the request is refused. Later cuts,
        decisions and points by hand stay.
        """
        done = await robot.commands.ask_perception(session, ask.UndoRule(user=session.user, rule=rule))
        if not done.ok:
            return answer(done)
        restored = await robot.commands.ask(session, ask.RestoreAccepted(user=session.user, rule=rule))
        if not restored.ok:
            cause = restored.reason or reasons.unexplained()
            return answer(Result(restored.status, reasons.acceptances_not_restored(cause)))
        return answer(done)

    @router.get("/points/{point_id}/drawing", responses=query(SpurDrawing, _NOT_YET, NOT_FOUND))
    async def point_drawing(session: Caller, point_id: PointId) -> Response:
        """Where the cut of a point and the wood around it are in its picture. 204 while there is none: ask again."""
        return _drawing(robot.link.pictures.of_point(point_id)) or _no_picture(point_id)

    @router.get("/points/{point_id}/picture", response_class=Response, responses=_PICTURE)
    async def point_picture(session: Caller, point_id: PointId, image: Image = None) -> Response:
        """The camera image of a point's spur, as JPEG; with `image` the one that a drawing is of.

        204 while it has not come: ask again.
        """
        return _jpeg(robot.link.pictures.of_point(point_id), image) or _no_picture(point_id)

    @router.get("/spurs/{vine}/{spur}/drawing", responses=query(SpurDrawing, _NOT_YET, INVALID))
    async def spur_drawing(session: Caller, vine: Number, spur: Number) -> Response:
        """The same of a spur, as of an undecided one."""
        return _drawing(robot.link.pictures.of_spur(vine, spur)) or Response(status_code=204)

    @router.get("/spurs/{vine}/{spur}/picture", response_class=Response, responses=_PICTURE)
    async def spur_picture(session: Caller, vine: Number, spur: Number, image: Image = None) -> Response:
        """The camera image of a spur, as JPEG; with `image` the one that a drawing is of. 204 while there is none."""
        return _jpeg(robot.link.pictures.of_spur(vine, spur), image) or Response(status_code=204)

    def _no_picture(point_id: str) -> Response:
        known = robot.pages.points.points if robot.pages.points is not None else ()
        if any(row.point.point_id == point_id for row in known):
            # Not an error, which a browser's console would show.
            return Response(status_code=204)
        return answer(Result(404, reasons.point_unknown(point_id)))

    return router


def _drawing(picture: SpurPicture | None) -> Response | None:
    return None if picture is None else message(picture.drawing)


def _jpeg(picture: SpurPicture | None, image: str | None) -> Response | None:
    if picture is None or image not in (None, picture.drawing.image):
        return None
    cache = "no-store" if image is None else "private, max-age=3600, immutable"
    return Response(picture.jpeg, media_type="image/jpeg", headers={"Cache-Control": cache})


def rule_outcome(effect: RuleEffect, points: PagePoints | None) -> dict[str, Any]:
    """The effect of a rule and the acceptances that it would void, as numbers and as a reason."""
    rows = () if points is None else points.points
    accepted = {row.point.point_id for row in rows if row.entry.state in ("ACCEPTED", "UNREACHABLE")}
    voided = len(accepted & {*effect.changed, *effect.removed})
    changed, removed, added = len(effect.changed), len(effect.removed), effect.added
    some = changed or removed or added or voided
    told = reasons.rule_effect(changed, removed, added, voided) if some else reasons.rule_without_effect()
    return outcome(True, told) | {"changed": changed, "removed": removed, "added": added, "voided": voided}
