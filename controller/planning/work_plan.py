"""The plan of a session as data, and its message."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import pinocchio as pin

from controller.planning.plan import Plan
from controller.work.posture_search import CutPlan
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, PruningPoint
from rolling_panda.messages.supervision import PlannedPoint, PlanRow, PlanState, PointPlan, SessionPlan
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import pose_message
from rolling_panda.model.wire_values import actuated, planar_pose


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """Everything that a plan depends on, apart from the configuration.

    Attributes:
        number: Grows by one a request.
        q: Configuration (12) at the start.
        points: Accepted points, each as it was accepted.
        obstacles: What stands in the way.
        turned: Points of which somebody has said the turn of the approach about the cane, and that (rad).
        order: Points in the order that people want them in; of none the plan chooses it.
    """

    number: int
    q: Array
    points: tuple[PruningPoint, ...]
    obstacles: tuple[Capsule, ...] = ()
    order: tuple[str, ...] = ()
    turned: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class PlannedCut:
    """A cut that can be made.

    Attributes:
        point: As it was accepted.
        cut: Poses of the tool, and the robot's posture at each.
        way: Motion to where the tool stands clear of the canes.
        begins: When it begins (s from the start of the session).
        clearance: Least distance on the way (m).
        between: Between what.
        manipulability: Least ω of the arm on the way and at the cut.
        torque_margin: Of the joint that uses the largest share of its torque (Nm).
        torque_joint: That joint.
    """

    point: PruningPoint
    cut: CutPlan
    way: Plan
    begins: float
    clearance: float
    between: tuple[str, str]
    manipulability: float
    torque_margin: float
    torque_joint: str


@dataclass(frozen=True, eq=False)
class WorkPlan:
    """Answer to a request.

    Attributes:
        request: What was asked.
        cuts: In the order of work.
        refused: Reason for each point that is not worked on, by id.
        points: What is said of each point, for the wire.
        duration: Of the session (s).
        digest: SHA-256 of the request, the configuration and all of the answer; empty when planning failed.
        failure: Why there is no plan at all; empty when there is one.
    """

    request: PlanRequest
    cuts: tuple[PlannedCut, ...] = ()
    refused: dict[str, str] = field(default_factory=dict)
    points: tuple[PlannedPoint, ...] = ()
    duration: float = 0.0
    digest: str = ""
    failure: str = ""


#: Least time between two rows of a preview (s), and the most rows of one way.
_ROW_S, _MOST_ROWS = 0.1, 200


def session_plan(plan: WorkPlan | None, state: PlanState, reason: str, now: float) -> SessionPlan:
    """The message of a plan, None for when there is none.

    Args:
        plan: The plan.
        state: Whether it holds.
        reason: Why not.
        now: Monotonic time (s).
    """
    header = m.Header(now, "odom")
    if plan is None:
        return SessionPlan(header=header, state=state, reason=reason[:500])
    return SessionPlan(
        header=header,
        state=state,
        reason=reason[:500],
        plan_hash=plan.digest,
        duration_s=plan.duration,
        points=plan.points,
    )


def planned_points(
    request: PlanRequest, cuts: Sequence[PlannedCut], refused: dict[str, str]
) -> tuple[PlannedPoint, ...]:
    """What is said of each point of a request: the cuts in their order, then those refused."""
    points = [planned_point(cut, number) for number, cut in enumerate(cuts, 1)]
    revisions = {point.point_id: point.revision for point in request.points}
    points += [
        PlannedPoint(PointPlan(point_id=point_id, revision=revisions[point_id], order=0, reason=why[:500]))
        for point_id, why in refused.items()
    ]
    return tuple(points)


def planned_point(cut: PlannedCut, order: int) -> PlannedPoint:
    """One cut of the plan with the way to it."""
    return PlannedPoint(
        PointPlan(
            point_id=cut.point.point_id,
            revision=cut.point.revision,
            order=order,
            begins_s=cut.begins,
            duration_s=cut.way.duration,
            clearance=cut.clearance,
            between=cut.between,
            manipulability=cut.manipulability,
            torque_margin=cut.torque_margin,
            torque_joint=cut.torque_joint,
            base=planar_pose(cut.cut.q_cut),
            plan_hash=cut.way.digest,
        ),
        preview(cut.way),
    )


def preview(way: Plan) -> tuple[PlanRow, ...]:
    """Rows of a way for display: the first, some between, and the last."""
    last = len(way.t) - 1
    if not last:
        return (_row(way, 0),)
    step = max(math.ceil(_ROW_S / float(way.t[1]) - 1e-9), math.ceil(last / _MOST_ROWS))
    return tuple(_row(way, row) for row in (*range(0, last, step), last))


def _row(way: Plan, row: int) -> PlanRow:
    T = way.T_odom_tool[row]
    pose = pose_message(pin.SE3(T[:3, :3], T[:3, 3]))
    return PlanRow(float(way.t[row]), planar_pose(way.q[row]), actuated(way.q[row, 3:]), pose)
