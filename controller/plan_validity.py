"""Whether a plan still describes the world: each way in which it no longer does, in words."""

from collections.abc import Iterable, Sequence

import numpy as np

from controller.queue import Ticket
from controller.work_plan import WorkPlan
from rolling_panda.differential_drive import Array
from rolling_panda.messages import PointState
from rolling_panda.robot_model import ARM_Q
from rolling_panda.row_messages import Capsule

#: Something stands where nothing within this of it (m) stood when the plan was made.
OBSTACLE_TOLERANCE = 0.05
#: The robot at rest has left the place that the plan begins from: base (m), heading and arm joints (rad).
PLACE_TOLERANCE, TURN_TOLERANCE, JOINT_TOLERANCE = 0.05, 0.05, 0.1
#: No point of the robot is farther than this from the middle of its axle (m): what stands beyond is not in its way.
_REACH = 1.3
#: Rows of a way between two places of the base that are looked at.
_LOOK = 20
#: Along an obstacle's axis this far apart (m) places are compared.
_SPACING = 0.2
#: What became of a point by the work itself leaves the plan for the others as it is.
_WORKED: frozenset[PointState] = frozenset({"INTENT", "DONE", "FAILED_NOT_CUT", "UNKNOWN"})


def points_changed(plan: WorkPlan, tickets: Iterable[Ticket]) -> str:
    """How the accepted points differ from the planned ones; empty where they do not.

    Args:
        plan: The plan.
        tickets: All of the queue.
    """
    planned = {point.point_id: point for point in plan.request.points}
    now = {ticket.point.point_id: ticket for ticket in tickets}
    for point_id, ticket in now.items():
        if ticket.state != "ACCEPTED":
            continue
        if point_id not in planned:
            return f"{point_id} was accepted after it was made"
        if ticket.accepted != planned[point_id]:
            return f"{point_id} was accepted anew"
    for point_id in planned:
        if point_id not in now or now[point_id].state not in {"ACCEPTED", *_WORKED}:
            return f"{point_id} is no longer accepted"
    return ""


def place_changed(plan: WorkPlan, q: Array) -> str:
    """How far a robot at rest at q (12) is from where the plan begins; empty within the tolerances."""
    away = q - plan.request.q
    moved, turned = float(np.hypot(*away[:2])), abs(float(away[2]))
    arm = float(np.abs(away[ARM_Q]).max())
    if moved > PLACE_TOLERANCE:
        return f"the robot stands {moved:.2f} m from where it begins"
    if turned > TURN_TOLERANCE:
        return f"the robot is turned by {np.degrees(turned):.0f}° from where it begins"
    if arm > JOINT_TOLERANCE:
        return f"a joint of the arm is {arm:.2f} rad from where it begins"
    return ""


def obstacles_changed(plan: WorkPlan, now: Sequence[Capsule]) -> str:
    """What stands in the plan's way where nothing stood; empty where nothing does. What has gone changes nothing.

    Args:
        plan: The plan.
        now: What stands around now.
    """
    before = plan.request.obstacles
    if now is before or now == before or not plan.cuts:
        return ""
    known = _rods(before)
    track = np.vstack([cut.way.q[::_LOOK, :2] for cut in plan.cuts] + [cut.way.q[-1:, :2] for cut in plan.cuts])
    for capsule in now:
        places = _new(capsule, known)
        if len(places) and np.hypot(*(places[:, None, :2] - track).reshape(-1, 2).T).min() < _REACH:
            x, y, z = places[0]
            return f"a {capsule.kind} is seen at ({x:.1f}, {y:.1f}, {z:.1f}) m that was not when it was made"
    return ""


def _rods(capsules: Sequence[Capsule]) -> tuple[Array, Array, Array]:
    """Starts (n×3), spans (n×3) and radii (n) of capsules."""
    start = np.array([c.start for c in capsules], dtype=np.float64).reshape(-1, 3)
    end = np.array([c.end for c in capsules], dtype=np.float64).reshape(-1, 3)
    return start, end - start, np.array([max(c.start_radius, c.end_radius) for c in capsules], dtype=np.float64)


def _new(capsule: Capsule, rods: tuple[Array, Array, Array]) -> Array:
    """Places along the axis of a capsule (n×3) where it sticks out of all the rods by more than the tolerance."""
    start, span, radius = rods
    a, b = np.array(capsule.start), np.array(capsule.end)
    count = 2 + int(np.linalg.norm(b - a) / _SPACING)
    places: Array = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
    if not len(start):
        return places
    offset = places[:, None] - start
    square = np.maximum((span * span).sum(axis=1), 1e-12)
    share = np.clip((offset * span).sum(axis=2) / square, 0.0, 1.0)
    gap = np.linalg.norm(offset - share[..., None] * span, axis=2) - radius
    beyond = gap.min(axis=1) + max(capsule.start_radius, capsule.end_radius)
    sticking: Array = places[beyond > OBSTACLE_TOLERANCE]
    return sticking
