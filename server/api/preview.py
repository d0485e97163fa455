"""REST for previews: what the robot would do now, and a person's word that it may."""

import math

import msgspec
from fastapi import APIRouter, Response

from rolling_panda import messages as m
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import PreviewMotion, PreviewState
from server.api import bodies as body
from server.api.answers import ANSWERS, Caller, Operator, answer, gives, message
from server.robots.context import Result, RobotContext
from server.robots.link import Posture

#: The robot stands elsewhere than the preview begins: base (m), heading and joints (rad).
_MOVED, _TURNED, _BENT = 0.05, 0.05, 0.1


class Previewed(msgspec.Struct, frozen=True):
    """The preview as it is now; null before the first."""

    state: PreviewState | None
    motion: PreviewMotion | None


def preview_router(desk: RobotContext) -> APIRouter:
    """Everything under `/api/preview`."""
    router = APIRouter(prefix="/api/preview", tags=["preview"])

    @router.get("", responses=gives(Previewed))
    async def preview(session: Caller) -> Response:
        """State and motion of the preview: `state` and `motion`, which are null before the first."""
        state, motion = desk.link.preview.peek(), desk.link.preview_motion.peek()
        return message(Previewed(state.message if state else None, motion.message if motion else None))

    @router.post("", responses=ANSWERS)
    async def ask(session: Operator, request: body.AskPreview) -> Response:
        """Make a preview of all accepted points in their order, or of one of them alone."""
        return answer(await desk.ask(session, intents.AskPreview(user=session.user, point_id=request.point_id)))

    @router.post("/approve", responses=ANSWERS)
    async def approve(session: Operator, request: body.ApprovePreview) -> Response:
        """Approve the preview with this hash; refused where server or controller sees something changed."""
        state = desk.link.preview.peek()
        why = "" if state is None else outdated(state.message, request.preview_hash, desk.link.posture(state.at))
        if why:
            desk.note("warning", f"{session.user}: ApprovePreview refused: {why}")
            return answer(Result(409, False, why))
        wanted = intents.ApprovePreview(user=session.user, preview_hash=request.preview_hash)
        return answer(await desk.ask(session, wanted))

    @router.post("/required", responses=ANSWERS)
    async def require(session: Operator, request: body.RequirePreview) -> Response:
        """Whether a cut begins only with its preview approved."""
        return answer(await desk.ask(session, intents.RequirePreview(user=session.user, required=request.required)))

    return router


def outdated(state: PreviewState, preview_hash: str, posture: Posture | None) -> str:
    """Why the server does not pass an approval on; empty when it does.

    Args:
        state: Newest state of the preview.
        preview_hash: That is approved.
        posture: The robot as measured.
    """
    if state.phase == "expired":
        return f"the preview has expired: {state.reason}; ask for another one"
    if state.phase not in ("ready", "approved"):
        return "there is no preview to approve; ask for one"
    if preview_hash != state.preview_hash:
        return f"the preview is another one now: {state.preview_hash[:8]}, not {preview_hash[:8]}; look again"
    if posture is None or state.start is None or state.position is None:
        return "where the robot stands is not known"
    return _elsewhere(state.start, state.position, posture)


def _elsewhere(start: m.PlanarPose, position: m.Actuated, posture: Posture) -> str:
    base = posture.base
    moved = math.hypot(base.x - start.x, base.y - start.y)
    if moved > _MOVED:
        return f"the preview has expired: the base moved {moved:.2f} m; ask for another one"
    turned = abs(math.remainder(base.phi - start.phi, math.tau))
    if turned > _TURNED:
        return f"the preview has expired: the base turned by {math.degrees(turned):.0f}°; ask for another one"
    bent = max(abs(now - then) for now, then in zip(posture.position[2:], position[2:], strict=True))
    if bent > _BENT:
        return f"the preview has expired: a joint of the arm moved by {bent:.2f} rad; ask for another one"
    return ""
