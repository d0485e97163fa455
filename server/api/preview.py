"""REST for previews of the robot's motion, and their approval."""

import math

import msgspec
from fastapi import APIRouter, Response

from rolling_panda import messages as m
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import PreviewMotion, PreviewState
from server.api import bodies as body
from server.api.dependencies import Caller, Operator
from server.api.responses import COMMAND, answer, message, query
from server.robots.context import Result, RobotContext
from server.robots.link import Posture

#: Permitted deviation from the start of the preview: base (m), heading and joints of the arm (rad).
_BASE_TOLERANCE, _HEADING_TOLERANCE, _JOINT_TOLERANCE = 0.05, 0.05, 0.1


class Previewed(msgspec.Struct, frozen=True):
    """The newest preview; null before the first."""

    state: PreviewState | None
    motion: PreviewMotion | None


def preview_router(robot: RobotContext) -> APIRouter:
    """Everything under `/api/preview`."""
    router = APIRouter(prefix="/api/preview", tags=["preview"])

    @router.get("", responses=query(Previewed))
    async def preview(session: Caller) -> Response:
        """State and motion of the preview: `state` and `motion`, which are null before the first."""
        state, motion = robot.link.preview.peek(), robot.link.preview_motion.peek()
        return message(Previewed(state.message if state else None, motion.message if motion else None))

    @router.post("", responses=COMMAND)
    async def ask(session: Operator, request: body.RequestPreview) -> Response:
        """Make a preview of all accepted points in their order, or of one of them alone."""
        return answer(await robot.ask(session, intents.RequestPreview(user=session.user, point_id=request.point_id)))

    @router.post("/approve", responses=COMMAND)
    async def approve(session: Operator, request: body.ApprovePreview) -> Response:
        """Approve the preview with this hash; refused where the robot or the preview has changed."""
        state = robot.link.preview.peek()
        why = "" if state is None else outdated(state.message, request.preview_hash, robot.link.posture(state.at))
        if why:
            robot.note("warning", f"{session.user}: ApprovePreview refused: {why}")
            return answer(Result(409, False, why))
        wanted = intents.ApprovePreview(user=session.user, preview_hash=request.preview_hash)
        return answer(await robot.ask(session, wanted))

    @router.post("/required", responses=COMMAND)
    async def require(session: Operator, request: body.RequirePreview) -> Response:
        """Set whether each cut needs an approved preview."""
        return answer(await robot.ask(session, intents.RequirePreview(user=session.user, required=request.required)))

    return router


def outdated(state: PreviewState, preview_hash: str, posture: Posture | None) -> str:
    """Why an approval is refused; empty where it is passed on.

    Args:
        state: Newest state of the preview.
        preview_hash: Of the approval.
        posture: Measured; None where it is unknown.
    """
    if state.phase == "expired":
        return f"the preview has expired: {state.reason}; ask for another one"
    if state.phase not in ("ready", "approved"):
        return "there is no preview to approve; ask for one"
    if preview_hash != state.preview_hash:
        return f"the preview is another one now: {state.preview_hash[:8]}, not {preview_hash[:8]}; look again"
    if posture is None or state.start is None or state.position is None:
        return "where the robot stands is not known"
    return _deviation(state.start, state.position, posture)


def _deviation(start: m.PlanarPose, position: m.Actuated, posture: Posture) -> str:
    base = posture.base
    moved = math.hypot(base.x - start.x, base.y - start.y)
    if moved > _BASE_TOLERANCE:
        return f"the preview has expired: the base moved {moved:.2f} m; ask for another one"
    turned = abs(math.remainder(base.phi - start.phi, math.tau))
    if turned > _HEADING_TOLERANCE:
        return f"the preview has expired: the base turned by {math.degrees(turned):.0f}°; ask for another one"
    joint_change = max(abs(now - then) for now, then in zip(posture.position[2:], position[2:], strict=True))
    if joint_change > _JOINT_TOLERANCE:
        return f"the preview has expired: a joint of the arm moved by {joint_change:.2f} rad; ask for another one"
    return ""
