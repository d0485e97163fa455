"""Commands of an operator: to the controller, to perception, to a replay."""

from typing import Annotated, Final, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.perception import PruningRule
from rolling_panda.messages.supervision import NEVER_SEEN_S
from rolling_panda.messages.types import (
    Count,
    Digest,
    Fraction,
    Message,
    Name,
    NonNegative,
    Role,
    Text,
    UnitVector3,
    Vector3,
)


class SeekReplay(Message, frozen=True, kw_only=True):
    """Server → replay: jump, play or pause.

    Attributes:
        position_s: New position from the beginning (s); None keeps the position.
        playing: Whether to play or pause there.
    """

    position_s: NonNegative | None = None
    playing: bool = True


class PlantRequest(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Base of the commands to perception.

    Attributes:
        user: Name of the operator.
    """

    user: Text


class SetRule(PlantRequest, frozen=True, kw_only=True):
    """Use another pruning rule from now on. All points change at once.

    Attributes:
        rule: The new rule.
    """

    rule: PruningRule = PruningRule()


class EvaluateRule(PlantRequest, frozen=True, kw_only=True):
    """Evaluate a pruning rule without using it. The answer has the `effect`.

    Attributes:
        rule: The rule.
    """

    rule: PruningRule = PruningRule()


class UndoRule(PlantRequest, frozen=True, kw_only=True):
    """Restore the rule and the points from before the current `rule` was set.

    Points that were cut or placed by hand since then stay as they are. `RestoreAccepted` restores the acceptances.

    Attributes:
        rule: The current rule.
    """

    rule: PruningRule


class AddPoint(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane nearest to a ray, as from a click in the 3-D view.

    Attributes:
        origin: Origin of the ray in odom (m).
        direction: Unit direction of the ray in odom.
    """

    origin: Vector3
    direction: UnitVector3


class AddPointInImage(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane under a pixel of a camera image.

    Attributes:
        sequence: `sequence` of the clicked camera frame; perception keeps the newest few frames.
        u: Column as a fraction of the width.
        v: Row as a fraction of the height.
    """

    sequence: Count
    u: Annotated[float, Meta(ge=0.0, le=1.0)]
    v: Annotated[float, Meta(ge=0.0, le=1.0)]


class MovePoint(PlantRequest, frozen=True, kw_only=True):
    """Move a point along its cane. The point is evaluated again and stays at this place.

    Attributes:
        point_id: The point.
        along: Distance (m), away from the cordon; negative towards it.
    """

    point_id: Name
    along: Annotated[float, Meta(ge=-0.1, le=0.1)]


AnyPlantRequest = SetRule | EvaluateRule | UndoRule | AddPoint | AddPointInImage | MovePoint
#: Default confidence from which `AcceptAll` accepts points.
SURE: Final = 0.8


class Intent(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Base of the commands to the controller.

    Attributes:
        user: Name of the operator.
        role: Role of the operator.
        client: Key of the client, to distinguish clients of one user; may be empty.
        view_age_s: Age of the newest state of the robot that the client had drawn or fetched when it asked (s).
    """

    user: Text
    role: Role = "operator"
    client: Annotated[str, Meta(max_length=64)] = ""
    view_age_s: NonNegative = NEVER_SEEN_S


class Arm(Intent, frozen=True, kw_only=True):
    """IDLE → READY."""


class AcceptPoint(Intent, frozen=True, kw_only=True):
    """Accept a proposed point.

    Attributes:
        point_id: The point.
        revision: Revision that the operator saw.
        digest: Hash of that revision, checked if given.
    """

    point_id: Name
    revision: Count
    digest: Digest = ""


class RejectPoint(Intent, frozen=True, kw_only=True):
    """Reject a point.

    Attributes:
        point_id: The point.
        reason: Reason, as text; may be empty.
    """

    point_id: Name
    reason: Text = ""


class ReconsiderPoint(Intent, frozen=True, kw_only=True):
    """Undo the decision about a point. An accepted or rejected point becomes a proposed one.

    Attributes:
        point_id: The point.
    """

    point_id: Name


class RestoreAccepted(Intent, frozen=True, kw_only=True):
    """Restore the acceptances that the change to `rule` made void. Perception undoes that rule.

    A point with a later decision, or one that differs from the accepted one, stays as it is.

    Attributes:
        rule: The rule that perception undoes.
    """

    rule: PruningRule


class ResolvePoint(Intent, frozen=True, kw_only=True):
    """Report the outcome of an UNKNOWN cut after an inspection.

    Attributes:
        point_id: The point.
        outcome: Whether it was cut.
        reason: What the person saw, as text.
    """

    point_id: Name
    outcome: Literal["DONE", "FAILED_NOT_CUT"]
    reason: Annotated[str, Meta(min_length=1, max_length=500)]


class AcceptAll(Intent, frozen=True, kw_only=True):
    """Accept all proposed points from a confidence on.

    Attributes:
        confidence: Smallest confidence, 0 … 1.
    """

    confidence: Fraction = SURE


class MoveInQueue(Intent, frozen=True, kw_only=True):
    """Move an accepted point in the order of work.

    Attributes:
        point_id: The point.
        before: Point that follows it; empty to move it to the end.
        revision: Revision of the order that the operator saw.
    """

    point_id: Name
    before: Annotated[str, Meta(max_length=64)] = ""
    revision: Count


class SetApproach(Intent, frozen=True, kw_only=True):
    """Set the direction of the approach to a point.

    Attributes:
        point_id: The point.
        azimuth: Turn about the cane (rad); 0 is straight from the robot's side; None leaves it to the posture search.
    """

    point_id: Name
    azimuth: Annotated[float, Meta(ge=-3.2, le=3.2)] | None = None


class ResetOrder(Intent, frozen=True, kw_only=True):
    """Return to the plan's order.

    Attributes:
        revision: Revision of the order that the operator saw.
    """

    revision: Count


class RequestPreview(Intent, frozen=True, kw_only=True):
    """Compute a preview of the accepted points in the order of work.

    Attributes:
        point_id: Preview this point alone; empty for all.
    """

    point_id: Annotated[str, Meta(max_length=64)] = ""


class ApprovePreview(Intent, frozen=True, kw_only=True):
    """Approve a preview. `Start` begins the work.

    Attributes:
        preview_hash: Hash of the preview that the operator saw.
    """

    preview_hash: Digest


class RequirePreview(Intent, frozen=True, kw_only=True):
    """Set whether a cut needs an approved preview.

    Attributes:
        required: Whether it does.
    """

    required: bool


class Start(Intent, frozen=True, kw_only=True):
    """READY → AUTO: work on the accepted points."""


class Survey(Start, frozen=True, kw_only=True):
    """READY → AUTO: drive along the row with the arm in its survey posture. Nothing is cut.

    Attributes:
        distance: Length of the survey (m).
        vine: With `spur`: number of the vine of an undecided site. Only this site is surveyed, from both sides.
        spur: Number of the spur of that site.
    """

    distance: Annotated[float, Meta(ge=0.1, le=500.0)] = 4.0
    vine: Annotated[int, Meta(ge=0, le=100000)] = 0
    spur: Annotated[int, Meta(ge=0, le=100000)] = 0


class Pause(Intent, frozen=True, kw_only=True):
    """AUTO or TELEOP → PAUSED."""


class Resume(Intent, frozen=True, kw_only=True):
    """PAUSED → READY. Work does not start."""


class Home(Intent, frozen=True, kw_only=True):
    """READY: move the arm to its survey posture beside the row."""


class Acknowledge(Intent, frozen=True, kw_only=True):
    """PROTECTIVE_STOP → PAUSED or FAULT → IDLE, after the cause is gone."""


class Reset(Intent, frozen=True, kw_only=True):
    """ESTOP_LATCHED → IDLE. It moves nothing.

    Attributes:
        reason: Reason for the reset, as text.
        stop_id: The newest stop that the supervisor saw, if given. A later stop stays latched.
    """

    reason: Annotated[str, Meta(min_length=1, max_length=500)]
    stop_id: Annotated[str, Meta(max_length=64)] = ""


class TakeControl(Intent, frozen=True, kw_only=True):
    """Take control of the robot's motion. If somebody else has control, the robot stops first.

    Attributes:
        confirmed: Required to take control from somebody else.
    """

    confirmed: bool = False


class RequestControl(Intent, frozen=True, kw_only=True):
    """Ask the holder for control."""


class GrantControl(Intent, frozen=True, kw_only=True):
    """Give control to the person who has asked for it. The robot stops first."""


class ReturnControl(Intent, frozen=True, kw_only=True):
    """Give up control. Motion is paused."""


AnyIntent = (
    Arm
    | AcceptPoint
    | RejectPoint
    | ReconsiderPoint
    | RestoreAccepted
    | ResolvePoint
    | AcceptAll
    | MoveInQueue
    | ResetOrder
    | SetApproach
    | RequestPreview
    | ApprovePreview
    | RequirePreview
    | Start
    | Survey
    | Pause
    | Resume
    | Home
    | Acknowledge
    | Reset
    | TakeControl
    | RequestControl
    | GrantControl
    | ReturnControl
)
#: Commands for the holder of control. A fault is acknowledged without control.
OF_HOLDER: Final = (Arm, Start, Survey, Resume, Home, Acknowledge)
