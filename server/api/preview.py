"""REST for previews of the robot's motion, and the check of their approval."""

import math

import msgspec
from fastapi import APIRouter, Response

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import PreviewMotion, PreviewState
from server.api.dependencies import Caller
from server.api.responses import message, query
from server.robots.context import RobotContext
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

    return router


def outdated_preview(robot: RobotContext, approval: intents.ApprovePreview) -> m.Reason | None:
    """Why an approval is refused, since the robot or the preview has changed; None where it is passed on."""
    state = robot.link.preview.peek()
    if state is None:
        return None
    return outdated(state.message, approval.preview_hash, robot.link.posture(state.at))


def outdated(state: PreviewState, preview_hash: str, posture: Posture | None) -> m.Reason | None:
    """Why an approval is refused; None where it is passed on.

    Args:
        state: Newest state of the preview.
        preview_hash: Of the approval.
        posture: Measured; None where it is unknown.
    """
    if state.phase == "expired" and state.reason is not None:
        return reasons.preview_expired(state.reason)
    if state.phase not in ("ready", "approved"):
        return reasons.preview_missing()
    if preview_hash != state.preview_hash:
        return reasons.preview_replaced(state.preview_hash[:8], preview_hash[:8])
    if posture is None or state.start is None or state.position is None:
        return reasons.posture_unknown()
    return _deviation(state.start, state.position, posture)


def _deviation(start: m.PlanarPose, position: m.Actuated, posture: Posture) -> m.Reason | None:
    x, y, heading = posture.q_in_map[:3].tolist()
    moved = math.hypot(x - start.x, y - start.y)
    if moved > _BASE_TOLERANCE:
        return reasons.preview_base_moved(moved)
    turned = abs(math.remainder(heading - start.phi, math.tau))
    if turned > _HEADING_TOLERANCE:
        return reasons.preview_base_turned(math.degrees(turned))
    joint_change = max(abs(now - then) for now, then in zip(posture.position[2:], position[2:], strict=True))
    if joint_change > _JOINT_TOLERANCE:
        return reasons.preview_arm_moved(joint_change)
    return None
