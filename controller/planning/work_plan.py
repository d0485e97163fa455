"""The plan of the work as data, and its message."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.work.posture_search import CutPlan, Polylines
from controller.work.tries import Made
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, PruningPoint
from rolling_panda.messages.supervision import PlanState, PointPlan, PreviewedCut, SessionPlan
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.wire_values import planar_pose


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
        tries: Failed tries of each point, with the cane that was met.
        close_up_s: Time from the request of a close-up to its result (s).
        canes: Axes of all standing canes (m).
    """

    number: int
    q: Array
    points: tuple[PruningPoint, ...]
    obstacles: tuple[Capsule, ...] = ()
    order: tuple[str, ...] = ()
    turned: tuple[tuple[str, float], ...] = ()
    tries: Made = ()
    close_up_s: float = 0.5
    canes: Polylines = ()


@dataclass(frozen=True, eq=False)
class PlannedCut:
    """A feasible cut.

    Attributes:
        point: The point as accepted.
        cut: Poses of the tool, with the robot's posture at each.
        rollout: Figures of the motion; None for a later cut, which is not rolled out yet.
    """

    point: PruningPoint
    cut: CutPlan
    rollout: PreviewedCut | None


@dataclass(frozen=True, eq=False)
class WorkPlan:
    """Result of a request.

    Attributes:
        request: The request.
        cuts: Feasible cuts in the order of work.
        refused: Reason for each refused point, by id.
        track: Positions of the base along the rollout (n×2, m).
        duration: Duration of the work (s).
        digest: SHA-256 of request, configuration and result; empty if planning failed.
        failure: Reason for the failure; None otherwise.
    """

    request: PlanRequest
    cuts: tuple[PlannedCut, ...] = ()
    refused: dict[str, m.Reason] = field(default_factory=dict)
    track: Array = field(default_factory=lambda: np.empty((0, 2)))
    duration: float = 0.0
    digest: str = ""
    failure: m.Reason | None = None


def session_plan(plan: WorkPlan | None, state: PlanState, reason: m.Reason | None, now: float) -> SessionPlan:
    """The message of a plan, None for when there is none.

    Args:
        plan: The plan.
        state: Whether it holds.
        reason: Why not.
        now: Monotonic time (s).
    """
    header = m.Header(now, "map")
    if plan is None:
        return SessionPlan(header=header, state=state, reason=reason)
    return SessionPlan(
        header=header,
        state=state,
        reason=reason,
        plan_hash=plan.digest,
        duration_s=plan.duration,
        points=_point_plans(plan.request, plan.cuts, plan.refused),
    )


def _point_plans(
    request: PlanRequest, cuts: Sequence[PlannedCut], refused: dict[str, m.Reason]
) -> tuple[PointPlan, ...]:
    """Plan of each point of a request: the cuts in their order, then the refused points."""
    points = [
        PointPlan(
            point_id=each.point.point_id,
            revision=each.point.revision,
            order=order,
            base=planar_pose(each.cut.q_cut),
            rollout=each.rollout,
        )
        for order, each in enumerate(cuts, 1)
    ]
    revisions = {point.point_id: point.revision for point in request.points}
    points += [
        PointPlan(point_id=point_id, revision=revisions[point_id], order=0, reason=why)
        for point_id, why in refused.items()
    ]
    return tuple(points)
