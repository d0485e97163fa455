"""The session's plan on the wire: what will be done in which order, and what cannot be done and why."""

from typing import Literal

from msgspec import Struct

from rolling_panda.messages import (
    Actuated,
    Count,
    Digest,
    Finite,
    Header,
    Message,
    Name,
    NonNegative,
    PlanarPose,
    Pose,
    Text,
)

PlanState = Literal["none", "planning", "valid", "void"]


class PointPlan(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the plan says of one accepted point.

    Attributes:
        point_id: Of the point.
        revision: That was accepted, and that the plan is for.
        order: 1 for the first that is worked on; 0 when the plan refuses the point.
        reason: Why it is refused, empty when it is not.
        begins_s: When the way to it begins, from the start of the session (s).
        duration_s: Of the way to it, up to where the tool stands clear of the canes (s).
        clearance: Least distance on that way between the robot's parts, and from them to the ground and obstacles (m).
        between: Between what that is.
        manipulability: Least ω of the arm at the cut and on the way to it.
        torque_margin: What is left of the torque of the joint that uses the largest share of its own (Nm).
        torque_joint: That joint.
        base: Where the base stands for the cut; None when refused.
        plan_hash: SHA-256 of the way in every control period; empty when refused.
    """

    point_id: Name
    revision: Count
    order: Count
    reason: Text = ""
    begins_s: NonNegative = 0.0
    duration_s: NonNegative = 0.0
    clearance: Finite = 0.0
    between: tuple[Text, Text] = ("", "")
    manipulability: NonNegative = 0.0
    torque_margin: Finite = 0.0
    torque_joint: Text = ""
    base: PlanarPose | None = None
    plan_hash: Digest = ""


class PlanRow(Struct, frozen=True, forbid_unknown_fields=True):
    """A moment of a planned way.

    Attributes:
        time: From the beginning of the way (s).
        base: base_link in odom.
        position: Actuated coordinates (rad).
        T_odom_tool: Tool pose.
    """

    time: NonNegative
    base: PlanarPose
    position: Actuated
    T_odom_tool: Pose


class PlannedPoint(Struct, frozen=True, forbid_unknown_fields=True):
    """One accepted point of the plan: what is said of it, and the way to it, thinned out for display."""

    plan: PointPlan
    preview: tuple[PlanRow, ...] = ()


class SessionPlan(Message, frozen=True, kw_only=True):
    """Controller → all: how the accepted points will be worked off.

    Attributes:
        header: `frame_id` is odom.
        state: `valid` while work follows it; `void` once something changed; `planning` until the next one is there.
        reason: Why it is void, or why there is none.
        plan_hash: SHA-256 of everything the plan was made from and of everything in it; empty when there is none.
        duration_s: Of the session, cuts included (s).
        points: Those to be worked on in their order, then those refused.
    """

    header: Header
    state: PlanState
    reason: Text = ""
    plan_hash: Digest = ""
    duration_s: NonNegative = 0.0
    points: tuple[PlannedPoint, ...] = ()
