"""The plan of a session as data: what it was asked for, and what came of it for each accepted point."""

from dataclasses import dataclass, field

from controller.planning.plan import Plan
from controller.reach import CutPlan
from rolling_panda.differential_drive import Array
from rolling_panda.messages import PruningPoint
from rolling_panda.plan_messages import PlannedPoint
from rolling_panda.row_messages import Capsule


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
