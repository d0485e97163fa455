"""Whether a point is still what was accepted, by a closer look before its cut."""

import numpy as np

from controller.config import ControllerConfig
from controller.motion import Measured
from controller.queue import Ticket
from controller.tool_motion import ToolMotion
from rolling_panda.look_messages import CloseLook

#: From farther away the base has to come first, before the canes are entered (m).
_BASE_NEAR = 0.1


def not_as_accepted(look: CloseLook, ticket: Ticket | None, tolerance: float) -> str:
    """Why a point is not cut after a closer look, in words; empty when it is.

    Args:
        look: What was seen.
        ticket: Of the point.
        tolerance: It may have moved so far since it was accepted (m).
    """
    if ticket is None or ticket.accepted is None:
        return "it is not accepted any more"
    if look.finding == "severed":
        return "on a closer look its cane is off already"
    if look.finding == "changed":
        return f"on a closer look {look.reason}: accept it again if it is right"
    if look.finding == "unseen" or look.position is None:
        return f"a closer look did not show it: {look.reason}"
    moved = float(np.linalg.norm(np.subtract(look.position, ticket.accepted.position)))
    if moved > tolerance:
        return f"moved {1e3 * moved:.0f} mm on a closer look: accept it again"
    return ""


def camera_ready(robot: Measured, motion: ToolMotion, config: ControllerConfig) -> bool:
    """Whether the camera has the point in view from near, and hardly moves.

    Args:
        robot: Measured robot.
        motion: To where the tool is clear of the canes.
        config: How near, and how slow.
    """
    away = robot.kinematics.T_odom_tool.translation - motion.goal.translation
    speed = float(np.linalg.norm(robot.kinematics.J_xi[:3] @ robot.sent))
    base = float(np.linalg.norm(robot.q[:2] - motion.q_goal[:2]))
    return float(np.linalg.norm(away)) < config.look_within and base < _BASE_NEAR and speed < config.look_speed
