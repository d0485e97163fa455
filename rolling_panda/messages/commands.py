"""What an operator may ask: of the controller, of perception, of a replay."""

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
    """Server → replay: go on from `position_s` (s from the beginning; None from where it is), or stand still there."""

    position_s: NonNegative | None = None
    playing: bool = True


class PlantRequest(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of what an operator may ask of perception. `user` is who asks."""

    user: Text


class SetRule(PlantRequest, frozen=True, kw_only=True):
    """Prune by these numbers from now on; points of all that was seen change at once."""

    rule: PruningRule = PruningRule()


class EvaluateRule(PlantRequest, frozen=True, kw_only=True):
    """Say what these numbers would change. Nothing changes; the answer has an `effect`."""

    rule: PruningRule = PruningRule()


class UndoRule(PlantRequest, frozen=True, kw_only=True):
    """Prune as before `rule`, which is in force, was set, with the points as they were then.

    What was cut or placed by hand meanwhile stays so. The controller is asked for the acceptances afterwards.
    """

    rule: PruningRule


class AddPoint(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane that a line of sight passes nearest, as from a click into the 3-D view.

    Attributes:
        origin: Where the line begins, in odom (m).
        direction: Along it, in odom.
    """

    origin: Vector3
    direction: UnitVector3


class AddPointInImage(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane under a pixel of a camera image.

    Attributes:
        sequence: Of the frame that was clicked; one of the newest few that perception has worked on.
        u: Column, as a share of the width.
        v: Row, as a share of the height.
    """

    sequence: Count
    u: Annotated[float, Meta(ge=0.0, le=1.0)]
    v: Annotated[float, Meta(ge=0.0, le=1.0)]


class MovePoint(PlantRequest, frozen=True, kw_only=True):
    """Move a point along its cane; it is judged anew, and from now on it is where a person wants it.

    Attributes:
        point_id: Of the point.
        along: So far (m), away from the cordon; negative towards it.
    """

    point_id: Name
    along: Annotated[float, Meta(ge=-0.1, le=0.1)]


AnyPlantRequest = SetRule | EvaluateRule | UndoRule | AddPoint | AddPointInImage | MovePoint
#: From this confidence on points are accepted all at once, where who asks names no other.
SURE: Final = 0.8


class Intent(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of what an operator may ask of the controller.

    Attributes:
        user: Who asks.
        role: What they may do.
        client: Tells apart who has the same name; empty where none has.
        view_age_s: Age of the newest state of the robot that they had drawn or fetched as they asked (s).
    """

    user: Text
    role: Role = "operator"
    client: Annotated[str, Meta(max_length=64)] = ""
    view_age_s: NonNegative = NEVER_SEEN_S


class Arm(Intent, frozen=True, kw_only=True):
    """IDLE → READY."""


class AcceptPoint(Intent, frozen=True, kw_only=True):
    """Put a proposed point on the queue; `revision` is the one the operator saw, `digest` its hash, if they say it."""

    point_id: Name
    revision: Count
    digest: Digest = ""


class RejectPoint(Intent, frozen=True, kw_only=True):
    """Take a point off the queue."""

    point_id: Name
    reason: Text = ""


class ReconsiderPoint(Intent, frozen=True, kw_only=True):
    """Take back what was decided about a point: accepted or rejected, it is proposed again."""

    point_id: Name


class RestoreAccepted(Intent, frozen=True, kw_only=True):
    """Accept again what the change to `rule` made void, as it was accepted; perception takes that rule back.

    A point that somebody has decided about since, or that is not as it was accepted, stays as it is.
    """

    rule: PruningRule


class ResolvePoint(Intent, frozen=True, kw_only=True):
    """Say how a cut ended of which nobody knows (UNKNOWN): somebody has looked."""

    point_id: Name
    outcome: Literal["DONE", "FAILED_NOT_CUT"]
    reason: Annotated[str, Meta(min_length=1, max_length=500)]


class AcceptAll(Intent, frozen=True, kw_only=True):
    """Accept every proposed point with at least this confidence; the others wait to be decided one by one."""

    confidence: Fraction = SURE


class MoveInQueue(Intent, frozen=True, kw_only=True):
    """Work on an accepted point before another one, or last; `revision` is that of the order the operator saw."""

    point_id: Name
    before: Annotated[str, Meta(max_length=64)] = ""
    revision: Count


class SetApproach(Intent, frozen=True, kw_only=True):
    """Approach a point with this turn about its cane (rad); 0 is straight from the robot's side, None as is found."""

    point_id: Name
    azimuth: Annotated[float, Meta(ge=-3.2, le=3.2)] | None = None


class ResetOrder(Intent, frozen=True, kw_only=True):
    """Work in the plan's order again; `revision` is that of the order the operator saw."""

    revision: Count


class RequestPreview(Intent, frozen=True, kw_only=True):
    """Show what the robot would do: all accepted points in their order, or one of them alone."""

    point_id: Annotated[str, Meta(max_length=64)] = ""


class ApprovePreview(Intent, frozen=True, kw_only=True):
    """The preview with this hash is what shall be done; work begins with `Start`."""

    preview_hash: Digest


class RequirePreview(Intent, frozen=True, kw_only=True):
    """From now on no cut begins without its preview approved, or cuts begin without."""

    required: bool


class Start(Intent, frozen=True, kw_only=True):
    """READY → AUTO on the accepted points."""


class Survey(Start, frozen=True, kw_only=True):
    """READY → AUTO along the row with the arm in its survey posture; nothing is cut. `distance` ahead (m).

    With `vine` and `spur` of an undecided site, that site alone is surveyed, from both its sides.
    """

    distance: Annotated[float, Meta(ge=0.1, le=500.0)] = 4.0
    vine: Annotated[int, Meta(ge=0, le=100000)] = 0
    spur: Annotated[int, Meta(ge=0, le=100000)] = 0


class Pause(Intent, frozen=True, kw_only=True):
    """AUTO or TELEOP → PAUSED."""


class Resume(Intent, frozen=True, kw_only=True):
    """PAUSED → READY; starting again is separate."""


class Home(Intent, frozen=True, kw_only=True):
    """READY: bring the arm back to its survey posture beside the row."""


class Acknowledge(Intent, frozen=True, kw_only=True):
    """PROTECTIVE_STOP → PAUSED, FAULT → IDLE, once the cause is gone."""


class Reset(Intent, frozen=True, kw_only=True):
    """ESTOP_LATCHED → IDLE, with a reason. It moves nothing.

    With `stop_id`, the newest stop that was looked at: one that was pressed since is not reset with it.
    """

    reason: Annotated[str, Meta(min_length=1, max_length=500)]
    stop_id: Annotated[str, Meta(max_length=64)] = ""


class TakeControl(Intent, frozen=True, kw_only=True):
    """Hold control of the robot's motion. From somebody else only with `confirmed`; the robot stops first."""

    confirmed: bool = False


class RequestControl(Intent, frozen=True, kw_only=True):
    """Ask who holds control to grant it."""


class GrantControl(Intent, frozen=True, kw_only=True):
    """Give control to who has asked for it; the robot stops first."""


class ReturnControl(Intent, frozen=True, kw_only=True):
    """Give control up; what moves is paused."""


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
#: What moves the robot or leads to it: for who holds control, but for the end of a fault.
OF_HOLDER: Final = (Arm, Start, Survey, Resume, Home, Acknowledge)
