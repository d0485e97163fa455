"""Commands of an operator: the message of each, and the table `COMMANDS` with their other properties.

REST routes and bodies, permissions, log texts, and the lists of the page and the documents are
generated from the table. The controller's handlers are in `controller/core.py`.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import degrees
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Union

from msgspec import Meta, Struct

from rolling_panda import reasons
from rolling_panda.messages.perception import PruningRule
from rolling_panda.messages.supervision import NEVER_SEEN_S, ArmAngles, ReplaySpeed
from rolling_panda.messages.types import (
    Count,
    Digest,
    Fraction,
    Message,
    Mode,
    Name,
    NonNegative,
    PointState,
    Process,
    Reason,
    Role,
    Text,
    UnitVector3,
    Vector3,
    WallTime,
)
from rolling_panda.mode_table import Event


class SeekReplay(Message, frozen=True, kw_only=True):
    """Server → replay: jump, play or pause, or set the speed.

    Attributes:
        position_s: New position from the beginning (s); None keeps the position.
        playing: Whether to play or pause there.
        speed: Seconds of the recording a second; None keeps the speed.
    """

    position_s: NonNegative | None = None
    playing: bool = True
    speed: ReplaySpeed | None = None


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
        origin: Origin of the ray in map (m).
        direction: Unit direction of the ray in map.
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


class UseCamera(PlantRequest, frozen=True, kw_only=True):
    """Use the new calibration of the camera from now on. All points are looked for anew.

    Attributes:
        made_at: `made_at` of the calibration that the operator saw.
    """

    made_at: WallTime


class MovePoint(PlantRequest, frozen=True, kw_only=True):
    """Move a point along its cane. The point is evaluated again and stays at this place.

    Attributes:
        point_id: The point.
        along: Distance (m), away from the cordon; negative towards it.
    """

    point_id: Name
    along: Annotated[float, Meta(ge=-0.1, le=0.1)]


class LeaveSite(PlantRequest, frozen=True, kw_only=True):
    """Leave an undecided site as it is, until something else is unclear there.

    Attributes:
        vine: Vine of the site.
        spur: Spur of the site.
        left: Whether it is left; False takes that back.
    """

    vine: Annotated[int, Meta(ge=1, le=100000)]
    spur: Annotated[int, Meta(ge=0, le=100000)]
    left: bool = True


#: States of a point in which a command about it is possible.
POINT_STATES: Final[dict[str, tuple[PointState, ...]]] = {
    "AcceptPoint": ("PROPOSED", "REJECTED", "FAILED_NOT_CUT"),
    "RejectPoint": ("PROPOSED", "ACCEPTED", "UNREACHABLE", "FAILED_NOT_CUT", "REJECTED"),
    "MovePoint": ("PROPOSED", "REJECTED", "FAILED_NOT_CUT"),
    "SetApproach": ("PROPOSED", "ACCEPTED", "UNREACHABLE", "FAILED_NOT_CUT", "REJECTED"),
    "ResolvePoint": ("UNKNOWN",),
    "JudgeCut": ("DONE",),
}
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
    reason: Annotated[str, Meta(min_length=1, max_length=400)]


class JudgeCut(Intent, frozen=True, kw_only=True):
    """Say that a finished cut was wrong, or that it was right after all. It moves nothing; networks learn from it.

    Attributes:
        point_id: The point.
        wrong: Whether it should not have been cut there.
    """

    point_id: Name
    wrong: bool


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
    """READY → AUTO. Drive along the row with the camera on the vines. It cuts nothing.

    Attributes:
        distance: Distance ahead along the row (m).
    """

    distance: Annotated[float, Meta(ge=0.1, le=500.0)] = 4.0


class LookAgain(Start, frozen=True, kw_only=True):
    """READY → AUTO. Drive to an undecided site and take images from both its sides. It cuts nothing.

    Attributes:
        vine: Vine of the site.
        spur: Spur of the site.
    """

    vine: Annotated[int, Meta(ge=1, le=100000)]
    spur: Annotated[int, Meta(ge=0, le=100000)]


class CalibrateCamera(Start, frozen=True, kw_only=True):
    """READY → AUTO. Look at the calibration's board from all around; the base stands still. It cuts nothing."""


class CheckCamera(Start, frozen=True, kw_only=True):
    """READY → AUTO. Look at the row from a few places, to check the camera's calibration. The base stands still."""


class CalibrateBase(Start, frozen=True, kw_only=True):
    """READY → AUTO. Drive and turn before the calibration's board, to measure the wheels. It cuts nothing."""


class UseBase(Intent, frozen=True, kw_only=True):
    """Use the new calibration of the base's wheels from now on. It moves nothing.

    Attributes:
        made_at: `made_at` of the calibration that the operator saw.
    """

    made_at: WallTime


class CalibrateArm(Start, frozen=True, kw_only=True):
    """READY → AUTO. Look at the calibration's board with many postures of the arm, to measure the zeros of its joints.

    The base stands still. It cuts nothing.
    """


class UseArm(Intent, frozen=True, kw_only=True):
    """Use the new calibration of the arm's joints from now on. It moves nothing. All points are looked for anew.

    Attributes:
        made_at: `made_at` of the calibration that the operator saw.
    """

    made_at: WallTime


class UseTiming(Intent, frozen=True, kw_only=True):
    """Use the new calibration of the camera's clock from now on. It moves nothing. All points are looked for anew.

    Attributes:
        made_at: `made_at` of the calibration that the operator saw.
    """

    made_at: WallTime


class Pause(Intent, frozen=True, kw_only=True):
    """AUTO or TELEOP → PAUSED."""


class Resume(Intent, frozen=True, kw_only=True):
    """PAUSED → READY. Work does not start."""


class Continue(Start, frozen=True, kw_only=True):
    """PAUSED or READY → AUTO. Go on with the work or the survey that was interrupted."""


class Home(Intent, frozen=True, kw_only=True):
    """READY: move the arm to its survey posture beside the row."""


class SavePosture(Intent, frozen=True, kw_only=True):
    """Save the present posture of the arm. It moves nothing.

    Attributes:
        posture: Name of the posture, as text.
    """

    posture: Text


class DeletePosture(Intent, frozen=True, kw_only=True):
    """Delete a saved posture.

    Attributes:
        posture: Name of the posture.
    """

    posture: Text


class CheckPosture(Intent, frozen=True, kw_only=True):
    """Ask whether the arm can go to a posture where the base stands. It moves nothing.

    Attributes:
        angles: Angles of the arm's joints (7, rad).
    """

    angles: ArmAngles


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
        confirm: Required to take control from somebody else.
    """

    confirm: bool = False


class RequestControl(Intent, frozen=True, kw_only=True):
    """Ask the holder for control."""


class GrantControl(Intent, frozen=True, kw_only=True):
    """Give control to the person who has asked for it. The robot stops first."""


class ReturnControl(Intent, frozen=True, kw_only=True):
    """Give up control. Motion is paused."""


#: Handles a command at a monotonic time (s). Returns the reason of a refusal; None if done.
Handler = Callable[[Any, float], Reason | None]
Handlers = dict[type[Struct], Handler]

#: Condition of a command beside its mode, whatever its arguments are. `controller/supervision/permission.py` checks
#: those of the robot, `controller/core.py` those of the work.
Condition = Literal[
    "fresh sensors",
    "bridge obeys",
    "server",
    "at rest",
    "workable point",
    "approved preview",
    "interrupted work",
    "perception",
    "watched",
    "acceptable point",
    "voided acceptances",
    "order by hand",
    "preview to approve",
    "stop to release",
]
#: Section of the REST interface.
Tag = Literal["mode", "points", "preview", "control"]


@dataclass(frozen=True)
class Command:
    """A command with its properties.

    Attributes:
        message: Type of the request. Its docstring and its own fields describe the route and its body.
        tag: Section of the REST interface.
        path: Path below `/api`, with fields in braces. Empty if another route sends it.
        log: Line of the log on success, made from the message; None if the handler or a change of mode logs.
        role: Lowest role that may use it.
        process: Process that answers.
        control: Whether it needs control, because it can lead to motion.
        event: Event of the state machine that it causes, which determines the modes where it is allowed.
        modes: Allowed modes of a command without an event; empty for all.
        conditions: Further conditions.
    """

    message: type[Intent] | type[PlantRequest]
    tag: Tag
    path: str = ""
    log: Callable[[Any], Reason] | None = None
    role: Role = "operator"
    process: Process = "controller"
    control: bool = False
    event: Event | None = None
    modes: tuple[Mode, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @property
    def name(self) -> str:
        """Name of the command: that of its message."""
        return self.message.__name__

    @property
    def words(self) -> str:
        """The name as words, for reasons: "look again"."""
        return re.sub(r"(?<!^)(?=[A-Z])", " ", self.name).lower()


def _rejected(asked: RejectPoint) -> Reason:
    if asked.reason:
        return reasons.point_rejected_because(asked.user, asked.point_id, asked.reason)
    return reasons.point_rejected(asked.user, asked.point_id)


def _resolved(asked: ResolvePoint) -> Reason:
    inspected = reasons.point_inspected_cut if asked.outcome == "DONE" else reasons.point_inspected_not_cut
    return inspected(asked.user, asked.point_id, asked.reason)


def _judged(asked: JudgeCut) -> Reason:
    judged = reasons.cut_judged_wrong if asked.wrong else reasons.cut_judged_right
    return judged(asked.user, asked.point_id)


def _moved(asked: MoveInQueue) -> Reason:
    if asked.before:
        return reasons.point_moved_before(asked.user, asked.point_id, asked.before)
    return reasons.point_moved_last(asked.user, asked.point_id)


def _approach(asked: SetApproach) -> Reason:
    if asked.azimuth is None:
        return reasons.approach_freed(asked.user, asked.point_id)
    return reasons.approach_set(asked.user, asked.point_id, degrees(asked.azimuth))


def _previewed(asked: RequestPreview) -> Reason:
    if asked.point_id:
        return reasons.point_preview_requested(asked.user, asked.point_id)
    return reasons.preview_requested(asked.user)


def _required(asked: RequirePreview) -> Reason:
    return (reasons.preview_required if asked.required else reasons.preview_optional)(asked.user)


_MOTION: Final[tuple[Condition, ...]] = ("fresh sensors", "bridge obeys", "server", "at rest")
_WATCHED_MOTION: Final[tuple[Condition, ...]] = (*_MOTION, "perception", "watched")

COMMANDS: Final[tuple[Command, ...]] = (
    Command(Arm, "mode", "/arm", control=True, event=Event.ARM, conditions=("fresh sensors", "bridge obeys")),
    Command(
        Start,
        "mode",
        "/start",
        control=True,
        event=Event.START,
        conditions=(*_MOTION, "workable point", "approved preview", "perception", "watched"),
    ),
    Command(Survey, "mode", "/survey", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(LookAgain, "mode", "/look-again", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(CalibrateCamera, "mode", "/camera/calibrate", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(CheckCamera, "mode", "/camera/check", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(CalibrateBase, "mode", "/base/calibrate", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(UseBase, "mode", "/base/use", modes=("IDLE", "READY", "PAUSED")),
    Command(CalibrateArm, "mode", "/arm/calibrate", control=True, event=Event.START, conditions=_WATCHED_MOTION),
    Command(UseArm, "mode", "/arm/use", modes=("IDLE", "READY", "PAUSED")),
    Command(UseTiming, "mode", "/timing/use", modes=("IDLE", "READY", "PAUSED")),
    Command(Pause, "mode", "/pause", event=Event.PAUSE),
    Command(Resume, "mode", "/resume", control=True, event=Event.RESUME),
    Command(
        Continue,
        "mode",
        "/continue",
        control=True,
        modes=("READY", "PAUSED"),
        conditions=("interrupted work", *_WATCHED_MOTION),
    ),
    Command(
        Home,
        "mode",
        "/home",
        lambda asked: reasons.home_requested(asked.user),
        control=True,
        modes=("READY",),
        conditions=_MOTION,
    ),
    Command(SavePosture, "mode", "/postures/save", lambda asked: reasons.posture_saved(asked.user, asked.posture)),
    Command(
        DeletePosture, "mode", "/postures/delete", lambda asked: reasons.posture_deleted(asked.user, asked.posture)
    ),
    Command(CheckPosture, "mode", "/postures/check"),
    Command(Acknowledge, "mode", "/acknowledge", control=True, event=Event.ACKNOWLEDGE),
    Command(Reset, "mode", "/reset", role="supervisor", event=Event.RESET, conditions=("stop to release",)),
    Command(AcceptAll, "points", "/points/accept-all", conditions=("acceptable point",)),
    Command(
        AcceptPoint,
        "points",
        "/points/{point_id}/accept",
        lambda asked: reasons.point_accepted(asked.user, asked.point_id, asked.revision),
    ),
    Command(
        RejectPoint,
        "points",
        "/points/{point_id}/reject",
        _rejected,
    ),
    Command(
        ReconsiderPoint,
        "points",
        "/points/{point_id}/reconsider",
        lambda asked: reasons.decision_undone(asked.user, asked.point_id),
    ),
    Command(ResolvePoint, "points", "/points/{point_id}/resolve", _resolved),
    Command(JudgeCut, "points", "/points/{point_id}/judge", _judged),
    Command(
        RestoreAccepted,
        "points",
        log=lambda asked: reasons.rule_undone(asked.user),
        conditions=("voided acceptances",),
    ),
    Command(
        MoveInQueue,
        "points",
        "/points/{point_id}/work-before",
        _moved,
    ),
    Command(AddPoint, "points", "/points/by-hand", process="perception"),
    Command(AddPointInImage, "points", "/points/by-hand-in-image", process="perception"),
    Command(MovePoint, "points", "/points/{point_id}/move", process="perception"),
    Command(UseCamera, "mode", "/camera/use", process="perception", modes=("IDLE", "READY", "PAUSED")),
    Command(LeaveSite, "points", "/sites/leave", process="perception"),
    Command(SetApproach, "points", "/points/{point_id}/approach", _approach),
    Command(
        ResetOrder,
        "points",
        "/order/planners",
        lambda asked: reasons.order_restored(asked.user),
        conditions=("order by hand",),
    ),
    Command(
        RequestPreview,
        "preview",
        "/preview",
        _previewed,
        conditions=("workable point",),
    ),
    Command(
        ApprovePreview,
        "preview",
        "/preview/approve",
        lambda asked: reasons.preview_approved(asked.user, asked.preview_hash[:8]),
        conditions=("preview to approve",),
    ),
    Command(
        RequirePreview,
        "preview",
        "/preview/required",
        _required,
    ),
    Command(TakeControl, "control", "/control/take"),
    Command(RequestControl, "control", "/control/request"),
    Command(GrantControl, "control", "/control/grant"),
    Command(ReturnControl, "control", "/control/return"),
)
COMMAND_OF: Final[dict[type[Struct], Command]] = {command.message: command for command in COMMANDS}
#: Messages to the controller, distinguished by their tags.
INTENTS: Final = tuple(command.message for command in COMMANDS if issubclass(command.message, Intent))

if TYPE_CHECKING:
    AnyIntent = Intent
else:
    AnyIntent = Union[INTENTS]  # noqa: UP007
