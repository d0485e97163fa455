"""The plan of the work as data, and its message."""

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
    """All inputs of a plan except the configuration file.

    Attributes:
        number: Increases by one with each request.
        q: Configuration (12) at the start.
        points: Points as accepted.
        obstacles: Obstacles.
        turned: Turn of the approach about the cane (rad) for points where a person has set it.
        order: Points in the order set by people; empty if the plan chooses the order.
    """

    number: int
    q: Array
    points: tuple[PruningPoint, ...]
    obstacles: tuple[Capsule, ...] = ()
    order: tuple[str, ...] = ()
    turned: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class PlannedCut:
    """A feasible cut.

    Attributes:
        point: The point as accepted.
        cut: Poses of the tool, with the robot's posture at each.
        way: Motion to the pose clear of the canes.
        begins: Start of the motion (s from the start of the work).
        clearance: Smallest distance along the motion (m).
        between: The two parts with that distance.
        manipulability: Smallest ω of the arm along the motion and at the cut.
        torque_margin: Remaining torque of the joint that uses the largest fraction of its limit (Nm).
        torque_joint: Name of that joint.
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
    """Result of a request.

    Attributes:
        request: The request.
        cuts: Feasible cuts in the order of work.
        refused: Reason for each refused point, by id.
        points: Plan of each point, for the message.
        duration: Duration of the work (s).
        digest: SHA-256 of request, configuration and result; empty if planning failed.
        failure: Reason for the failure, as text; empty otherwise.
    """

    request: PlanRequest
    cuts: tuple[PlannedCut, ...] = ()
    refused: dict[str, str] = field(default_factory=dict)
    points: tuple[PlannedPoint, ...] = ()
    duration: float = 0.0
    digest: str = ""
    failure: str = ""


#: Shortest time between two rows of a preview (s), and the largest number of rows of one motion.
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
    """Plan of each point of a request: the cuts in their order, then the refused points."""
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
