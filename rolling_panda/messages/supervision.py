"""The controller's state, who holds control, plans, previews, teleoperation and the session's report."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.perception import PruningPoint
from rolling_panda.messages.types import (
    Actuated,
    Angle,
    Count,
    Digest,
    Finite,
    Header,
    Interrupted,
    Message,
    Metre,
    Mode,
    Name,
    NonNegative,
    Outcome,
    Phase,
    PlanarPose,
    PointState,
    Pose,
    Process,
    Role,
    Text,
    Vector3,
)

#: Seconds since 1970, of people's clocks.
WallTime = Annotated[float, Meta(ge=0.0, le=1e11)]


class ReplayState(Message, frozen=True, kw_only=True):
    """Replay → server: what is on the wire is a recording.

    Attributes:
        name: Of the file.
        begins_at: When its first message was recorded (s since 1970).
        duration_s: From the first to the last message.
        position_s: Where it is played now, from its beginning.
        playing: False while it stands still.
    """

    name: Text
    begins_at: WallTime
    duration_s: NonNegative
    position_s: NonNegative
    playing: bool


class QueueEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """A pruning point in the controller's queue: its life, why it is where it is, the `digest` that was accepted.

    `recorded` is the point as the ledger has it, where perception does not show it and somebody has to decide.
    `azimuth` is the turn of the approach about the cane (rad) that somebody wants, None where the search chooses it.
    """

    point_id: Name
    state: PointState
    reason: Text = ""
    user: Text = ""
    cut_id: Annotated[str, Meta(max_length=64)] = ""
    accepted_position: Vector3 | None = None
    digest: Digest = ""
    recorded: "PruningPoint | None" = None
    azimuth: Angle | None = None


class Proximity(Struct, frozen=True, forbid_unknown_fields=True):
    """The least distance (m) between two things that must not touch, and which; negative where they overlap."""

    distance: Metre
    what: Text


class QueueOrder(Struct, frozen=True, forbid_unknown_fields=True):
    """Whose order of work it is: that of `user`, or the plan's where empty; `revision` counts people's changes."""

    revision: Count = 0
    user: Text = ""


class ControllerState(Message, frozen=True, kw_only=True):
    """Controller → all: mode, queue and the quality of tracking.

    Attributes:
        mode: State of the supervision machine.
        phase: Step of the cut sequence in AUTO, else empty.
        reason: Why the machine is in this mode.
        allowed: Intent types that would be taken now; every other one is answered with a reason.
        active_point_id: The point being worked on, empty when none.
        method: Name of the whole-body method.
        T_odom_tool: Measured tool pose.
        T_odom_tool_desired: Where the trajectory has it now; None when nothing is tracked.
        position_error: Tool position error (m).
        rotation_error: Tool rotation error (rad).
        manipulability: ω of the arm.
        joint_margin: Least distance of an arm joint to its limit (rad).
        tick_s: Median time of one control step over the last second (s).
        ticks: Control periods since the start.
        late_ticks: Those of them that lasted more than half as long again as they should.
        queue: Every point known, in the order of work.
        limited_by: What keeps the robot from doing all that is asked of it now, by name; empty where nothing does.
        proximity: What it is nearest to touching while it moves; None where nothing is near.
        order: Whose order that is.
        interrupted: What a pause or a protective stop has ended; empty once something is begun, or the robot disarmed.
        relaxed_limits: Safety limits that its configuration sets less strictly than usual, within their hard bounds.
    """

    header: Header
    mode: Mode
    phase: Phase
    reason: Text
    allowed: tuple[str, ...]
    active_point_id: Annotated[str, Meta(max_length=64)]
    method: Name
    T_odom_tool: Pose | None
    T_odom_tool_desired: Pose | None
    position_error: NonNegative
    rotation_error: NonNegative
    manipulability: NonNegative
    joint_margin: Finite
    tick_s: NonNegative
    ticks: Count
    late_ticks: Count
    queue: tuple[QueueEntry, ...]
    limited_by: Text = ""
    proximity: Proximity | None = None
    order: QueueOrder = QueueOrder()
    interrupted: Interrupted = ""
    relaxed_limits: tuple[Text, ...] = ()


#: Who asks, as others may see it: a digest of a session, never the session itself. Empty = nobody.
ClientKey = Annotated[str, Meta(max_length=64)]
#: The random part of a token.
Nonce = Annotated[str, Meta(max_length=32, pattern=r"^[0-9a-f]*(?!\n)$")]
#: A view that has shown nothing yet counts as this old (s).
NEVER_SEEN_S = 1e6


class Person(Struct, frozen=True, forbid_unknown_fields=True):
    """Somebody whose page or script is heard from now.

    Attributes:
        key: Who.
        user: Their name.
        role: What they may do.
        heard_age_s: Since they last said something (s).
        view_age_s: Age of the newest state of the robot that they have drawn or fetched (s).
    """

    key: ClientKey
    user: Text
    role: Role
    heard_age_s: NonNegative
    view_age_s: NonNegative


class Presence(Message, frozen=True, kw_only=True):
    """Server → controller: who is there. It renews the lease of the one who holds control, from their last word on.

    Attributes:
        sequence: Strictly increasing; one that is not above the last counts for nothing.
        people: Everybody heard from within the last second.
    """

    sequence: Count
    people: tuple[Person, ...]


class ControlState(Message, frozen=True, kw_only=True):
    """Controller → all: the lease on the robot's motion.

    Attributes:
        holder: Key of who holds control, empty when nobody.
        user: Their name.
        expires_s: How long the lease still lives without a word of its holder (s).
        requested_by: Name of who asks for control, empty when nobody.
        requested_key: Their key.
        next_user: Name of who gets control as soon as the robot is at rest, empty when nobody.
        notice: What became of control last, in words.
        notice_number: Grows with each such change, so that a page tells each once.
        supervised: Whether somebody who may operate sees the robot now.
    """

    holder: ClientKey
    user: Text
    expires_s: NonNegative
    requested_by: Text
    requested_key: ClientKey
    next_user: Text
    notice: Text
    notice_number: Count
    supervised: bool


class StopRecord(Struct, frozen=True, forbid_unknown_fields=True):
    """One stop as a process has latched it.

    Attributes:
        stop_id: Its id.
        source: Process or input that it came from.
        user: Who pressed; empty where nobody did.
        reason: Why.
        wall_time: When this process latched it.
    """

    stop_id: Annotated[str, Meta(min_length=1, max_length=64)]
    source: Annotated[str, Meta(max_length=64)]
    user: Text
    reason: Text
    wall_time: WallTime


class StopState(Message, frozen=True, kw_only=True):
    """Bridge and controller → all: the stops that this process holds latched, the newest first.

    Attributes:
        process: Whose latch this is.
        stops: What is latched.
        released_by: Who released the last one that was, and why; empty before.
        hardware: Whether the hardware stop is pressed; always false from the controller.
    """

    process: Process
    stops: tuple[StopRecord, ...]
    released_by: Text = ""
    hardware: bool = False


class HardwareStop(Message, frozen=True, kw_only=True):
    """Anyone → the simulated bridge: press or release the robot's emergency stop button, which it does not have."""

    pressed: bool
    user: Text


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


PreviewPhase = Literal["none", "waiting", "rolling", "ready", "approved", "expired"]


class PreviewedCut(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One point of a preview, with the way to it and the way out again.

    Attributes:
        point_id: Of the point.
        revision: That is accepted, and that is previewed.
        begins_s: When the way to it begins (s from the start).
        cut_s: When the blades close (s from the start); None where they do not.
        ends_s: When the way to the next point begins, or the work ends (s from the start).
        result: How it ends, in words: cut, or why not.
        clearance: Least distance meanwhile between the robot's parts, and from them to ground and obstacles (m).
        between: Between what that is.
        manipulability: Least ω of the arm meanwhile.
        joint_margin: Least distance of an arm joint to its limit meanwhile (rad).
    """

    point_id: Name
    revision: Count
    begins_s: NonNegative
    cut_s: NonNegative | None
    ends_s: NonNegative
    result: Text
    clearance: Finite
    between: tuple[Text, Text]
    manipulability: NonNegative
    joint_margin: Finite


class PreviewState(Message, frozen=True, kw_only=True):
    """Controller → all: whether there is a preview, whether it still describes what would happen, and who approved it.

    Attributes:
        header: `frame_id` is odom.
        required: True while no cut begins that nobody has approved the preview of.
        phase: `waiting` for the robot to rest and the plan to be made, `rolling` while it is computed; `ready` to be
            approved; `expired` once something has changed.
        reason: What has changed, or what is waited for.
        preview_hash: SHA-256 of all that it was made from and of all that is in it; empty when there is none.
        approved_by: Who has approved it; empty when nobody has.
        start: Where the base begins.
        position: Actuated coordinates at the start (rad).
        duration_s: Of all of it (s).
        cuts: Points in their order.
        remaining: Accepted points that come after those, and are not in it.
    """

    header: Header
    required: bool
    phase: PreviewPhase
    reason: Text = ""
    preview_hash: Digest = ""
    approved_by: Text = ""
    start: PlanarPose | None = None
    position: Actuated | None = None
    duration_s: NonNegative = 0.0
    cuts: tuple[PreviewedCut, ...] = ()
    remaining: Count = 0


class PreviewRow(Struct, frozen=True, forbid_unknown_fields=True):
    """A moment of a preview: `time` from the start (s), base in odom, actuated coordinates (rad), tool in odom (m)."""

    time: NonNegative
    base: PlanarPose
    position: Actuated
    tool: Vector3


class PreviewMotion(Message, frozen=True, kw_only=True):
    """Controller → server: the motion of a preview, for the ghost in the 3-D view."""

    header: Header
    preview_hash: Digest
    rows: tuple[PreviewRow, ...] = ()


_Number = Annotated[int, Meta(ge=0, le=100000)]


class CutReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One cut and how it ended, or a point that was given up before the blades were asked to close.

    Attributes:
        cut_id: Of the cut; empty where the point was given up before there was one.
        point_id: Point that was to be cut.
        vine: Its vine.
        spur: Its spur on that vine.
        outcome: As it is known now; empty while it goes on.
        reason: In words.
        user: Who accepted it, or said how it ended.
        ended_at: When; 0 while it goes on.
        seconds: From the end of the cut before, or the start of work if that was later, to the end of this one.
    """

    cut_id: ClientKey = ""
    point_id: Name
    vine: _Number
    spur: _Number
    outcome: Outcome = ""
    reason: Text = ""
    user: Text = ""
    ended_at: WallTime = 0.0
    seconds: NonNegative = 0.0


class VineReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The cuts of one vine by outcome, points accepted there that cannot be reached, and the time of the cuts (s)."""

    vine: _Number
    done: Count = 0
    not_cut: Count = 0
    unknown: Count = 0
    unreachable: Count = 0
    seconds: NonNegative = 0.0


class RefusalReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What somebody asked for and did not get: when, who, what, and why."""

    at: WallTime
    user: Text
    asked: Text
    reason: Text


class ControlReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Somebody took, granted or returned control: when, who, and what."""

    at: WallTime
    user: Text
    what: Text


class SessionReport(Message, frozen=True, kw_only=True):
    """Controller → all: what has happened since it started, as far as it is on disk.

    Attributes:
        began_at: When the controller started.
        written_at: When the newest row of the ledger was written that is in here.
        cuts: The newest cuts, oldest first.
        cut_count: All cuts, those left out of `cuts` too.
        vines: Each vine with a cut or a point that cannot be reached, by its number; all of them count.
        refusals: The newest refusals.
        refusal_count: All of them.
        control: The newest changes of control.
    """

    began_at: WallTime
    written_at: WallTime
    cuts: tuple[CutReport, ...] = ()
    cut_count: Count = 0
    vines: tuple[VineReport, ...] = ()
    refusals: tuple[RefusalReport, ...] = ()
    refusal_count: Count = 0
    control: tuple[ControlReport, ...] = ()


JointVelocity = Annotated[float, Meta(ge=-10.0, le=10.0)]
#: Speed by hand, relative to the robot's usual one.
SpeedScale = Annotated[float, Meta(ge=0.05, le=1.0)]
ArmVelocities = tuple[
    JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity
]


class BaseVelocity(Struct, frozen=True, forbid_unknown_fields=True):
    """Forward velocity (m/s) and yaw rate (rad/s) of the base."""

    linear: Annotated[float, Meta(ge=-2.0, le=2.0)]
    angular: Annotated[float, Meta(ge=-4.0, le=4.0)]


class TeleopTarget(Message, frozen=True, kw_only=True):
    """Server → controller while the operator holds: what the robot should do.

    A `target` alone is followed by the tool, with base and arm together. With `base` beside it, the tool keeps to the
    target while the base moves under it, as far as the arm allows. `base` alone drives with the arm still, `joints`
    alone turns joints with the base still.

    Attributes:
        sequence: Strictly increasing; one that is not above the last is refused until the hold has ended by silence.
        hold: False ends the hold at once; silence ends it too.
        user: Who holds.
        target: Desired T_odom_tool in odom.
        base: Velocity of the base.
        joints: Velocities of the arm's joints (7, rad/s).
        client: Tells apart who has the same name, as in an intent.
        speed_scale: Of the usual speed, for all of the above.
        round_trip_s: From the holder's page to the server and back, as the server measured it (s).
    """

    sequence: Count
    hold: bool
    user: Text
    target: Pose | None = None
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    client: Annotated[str, Meta(max_length=64)] = ""
    speed_scale: SpeedScale = 1.0
    round_trip_s: NonNegative = 0.0
