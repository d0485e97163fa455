"""Messages of supervision: controller state, control, stops, plan, preview, teleoperation and report."""

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
    Reason,
    Role,
    Text,
    Vector3,
    WallTime,
)

#: Seconds of a recording that are replayed a second.
ReplaySpeed = Annotated[float, Meta(ge=0.5, le=8.0)]


class ReplayState(Message, frozen=True, kw_only=True):
    """Replay → server: the wire carries a recording instead of a robot.

    Attributes:
        name: Name of the file.
        begins_at: Time of the first recorded message (s since 1970).
        duration_s: Time from the first to the last message (s).
        position_s: Current position from the beginning (s).
        playing: False while the replay is paused.
        speed: Seconds of the recording a second.
        complete: False if its recorder was killed before the end.
    """

    name: Text
    begins_at: WallTime
    duration_s: NonNegative
    position_s: NonNegative
    playing: bool
    speed: ReplaySpeed = 1.0
    complete: bool = True


class QueueEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """A pruning point in the controller's queue.

    Attributes:
        point_id: The point.
        state: State of the point.
        reason: Reason for the state; None without one.
        user: The person who last decided about the point.
        cut_id: Its last cut; empty before the first.
        accepted_position: Position at acceptance, in map (m).
        digest: Hash of the accepted point, see `PruningPoint.digest`.
        recorded: The point from the ledger, if perception does not report it and a person has to decide.
        azimuth: Requested turn of the approach about the cane (rad); None if the posture search chooses it.
    """

    point_id: Name
    state: PointState
    reason: Reason | None = None
    user: Text = ""
    cut_id: Annotated[str, Meta(max_length=64)] = ""
    accepted_position: Vector3 | None = None
    digest: Digest = ""
    recorded: "PruningPoint | None" = None
    azimuth: Angle | None = None


class Proximity(Struct, frozen=True, forbid_unknown_fields=True):
    """The smallest monitored distance.

    Attributes:
        distance: Distance (m); negative in penetration.
        what: Names of the two parts.
    """

    distance: Metre
    what: Text


class QueueOrder(Struct, frozen=True, forbid_unknown_fields=True):
    """Origin of the order of work.

    Attributes:
        revision: Number of changes by people.
        user: The person who set the order; empty for the plan's order.
    """

    revision: Count = 0
    user: Text = ""


JointAngle = Annotated[float, Meta(ge=-7.0, le=7.0)]
#: Angles of the arm's joints, from the base on (rad).
ArmAngles = tuple[JointAngle, JointAngle, JointAngle, JointAngle, JointAngle, JointAngle, JointAngle]


class SavedPosture(Struct, frozen=True, forbid_unknown_fields=True):
    """A posture of the arm with a name.

    Attributes:
        name: Name, as text; of a posture of the program `survey` or `folded`.
        angles: Angles of the joints (7, rad).
        user: The person who saved it; empty for a posture of the program.
    """

    name: Text
    angles: ArmAngles
    user: Text = ""


class ControllerState(Message, frozen=True, kw_only=True):
    """Controller → all: mode, queue and tracking error.

    Attributes:
        header: Time of the state.
        mode: State of the supervision state machine.
        phase: Step of the cut sequence in AUTO; empty otherwise.
        reason: Reason for the mode.
        allowed: Reason why each command, or motion by hand (`Teleoperation`), would be refused now; None if it would
            be taken. What is among `of_holder` is told for the holder. The commands about control are left out.
        of_holder: What only the holder of control may do now; without a holder, every operator.
        of_supervisor: What only a supervisor may do now.
        active_point_id: Current point of the work; empty without one.
        method: Name of the whole-body method.
        T_odom_tool: Measured tool pose.
        T_odom_tool_desired: Desired tool pose on the trajectory; None without a trajectory.
        position_error: Tool position error (m).
        rotation_error: Tool rotation error (rad).
        manipulability: ω of the arm.
        joint_margin: Smallest distance of an arm joint to its limit (rad).
        kept_margin: Distance from the limit of every arm joint that no motion enters (rad).
        tick_s: Median duration of one control step over the last second (s).
        ticks: Control periods since the start.
        late_ticks: Control periods that lasted more than 1.5 times their nominal length.
        queue: All known points, in the order of work.
        limited_by: Name of the constraint that limits the current motion; empty without one.
        proximity: Smallest monitored distance during motion; None if nothing is near.
        order: Origin of the order of work.
        interrupted: Activity that a pause or a protective stop interrupted; empty after the next start, or when
            disarmed.
        relaxed_limits: Safety limits that its configuration sets less strictly than usual, within their hard bounds.
        postures: Postures that the arm can be led to: those of the program, then the saved ones.
        tool_force: Force at the tool that explains the arm's external torques (N); None without them.
    """

    header: Header
    mode: Mode
    phase: Phase
    reason: Reason
    allowed: dict[Name, Reason | None]
    of_holder: tuple[Name, ...] = ()
    of_supervisor: tuple[Name, ...] = ()
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
    relaxed_limits: tuple[Reason, ...] = ()
    postures: tuple[SavedPosture, ...] = ()
    tool_force: NonNegative | None = None
    kept_margin: NonNegative = 0.0


#: Public key of a client: a digest of its session, never the session itself. Empty = nobody.
ClientKey = Annotated[str, Meta(max_length=64)]
#: Age of the view of a client that has not seen any state yet (s).
NEVER_SEEN_S = 1e6


class Person(Struct, frozen=True, forbid_unknown_fields=True):
    """A person whose page or script was heard within the last second.

    Attributes:
        key: Key of the client.
        user: Name of the user.
        role: Role of the user.
        heard_age_s: Time since the last message of the client (s).
        view_age_s: Age of the newest state of the robot that the client has drawn or fetched (s).
    """

    key: ClientKey
    user: Text
    role: Role
    heard_age_s: NonNegative
    view_age_s: NonNegative


class Presence(Message, frozen=True, kw_only=True):
    """Server → controller: the people who are present. It renews the holder's lease from the holder's last message on.

    Attributes:
        sequence: Strictly increasing; a message that does not increase it is ignored.
        people: Everybody heard within the last second.
    """

    sequence: Count
    people: tuple[Person, ...]


class ControlState(Message, frozen=True, kw_only=True):
    """Controller → all: the lease on the robot's motion.

    Attributes:
        holder: Key of the holder; empty without one.
        user: Name of the holder.
        expires_s: Time to the end of the lease without a message of the holder (s).
        requested_by: Name of the person who asks for control; empty without one.
        requested_key: Key of that person.
        next_user: Name of the person who gets control when the robot is at rest; empty without one.
        notice: Last change of control; None before the first.
        notice_number: Increases with each change, so that a page shows each notice once.
        supervised: Whether a person who may operate the robot sees it now.
    """

    holder: ClientKey
    user: Text
    expires_s: NonNegative
    requested_by: Text
    requested_key: ClientKey
    next_user: Text
    notice: Reason | None
    notice_number: Count
    supervised: bool


class StopRecord(Struct, frozen=True, forbid_unknown_fields=True):
    """One stop that a process has latched.

    Attributes:
        stop_id: Id of the stop.
        source: Process or input that it came from.
        user: Who pressed; empty for a stop by a program.
        reason: Cause.
        wall_time: Time at which this process latched it (s since 1970).
    """

    stop_id: Annotated[str, Meta(min_length=1, max_length=64)]
    source: Annotated[str, Meta(max_length=64)]
    user: Text
    reason: Reason
    wall_time: WallTime


class StopState(Message, frozen=True, kw_only=True):
    """Bridge and controller → all: the latched stops of this process.

    Attributes:
        process: The sender.
        stops: Latched stops, newest first.
        released_by: Who made the last reset and why; None before the first.
        hardware: Whether the hardware stop is pressed; always false from the controller.
    """

    process: Process
    stops: tuple[StopRecord, ...]
    released_by: Reason | None = None
    hardware: bool = False


class HardwareStop(Message, frozen=True, kw_only=True):
    """Any process → simulated bridge: press or release the simulated emergency stop button.

    Attributes:
        pressed: Whether it is pressed.
        user: Who acts.
    """

    pressed: bool
    user: Text


class PreviewedCut(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One point of a rollout of the work, with the motion to it and out again.

    Attributes:
        point_id: The point.
        revision: Accepted revision that is previewed.
        begins_s: Start of the motion to it (s from the start).
        cut_s: Time at which the blades close (s from the start); None without a cut.
        ends_s: Start of the motion to the next point, or end of the work (s from the start).
        reason: Reason why it is not cut; None if it is.
        clearance: Smallest distance from `begins_s` to `ends_s`, among the robot's parts and to ground and
            obstacles (m).
        between: The two parts with that distance.
        manipulability: Smallest ω of the arm in that time.
        joint_margin: Smallest distance of an arm joint to its limit in that time (rad).
        torque_margin: Remaining torque of the joint that uses the largest fraction of its limit in that time (Nm).
        torque_joint: Name of that joint.
    """

    point_id: Name
    revision: Count
    begins_s: NonNegative
    cut_s: NonNegative | None
    ends_s: NonNegative
    reason: Reason | None
    clearance: Finite
    between: tuple[Text, Text]
    manipulability: NonNegative
    joint_margin: Finite
    torque_margin: Finite = 0.0
    torque_joint: Text = ""


PlanState = Literal["none", "planning", "valid", "void"]


class PointPlan(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Plan for one accepted point: its place in the work, or the reason for a refusal.

    Attributes:
        point_id: The point.
        revision: Accepted revision that the plan is for.
        order: Position in the order of work, from 1; 0 for a refused point.
        reason: Reason for the refusal; None otherwise.
        base: Pose of base_link in map at the cut; None for a refused point.
        rollout: Figures of the motion to it and out again; None for a refused point, and for a later one
            until the work comes near it.
    """

    point_id: Name
    revision: Count
    order: Count
    reason: Reason | None = None
    base: PlanarPose | None = None
    rollout: PreviewedCut | None = None


class SessionPlan(Message, frozen=True, kw_only=True):
    """Controller → all: order and rollout of the work on the accepted points.

    Attributes:
        header: `frame_id` is map.
        state: `valid` while the work follows the plan; `void` after a change; `planning` until the next plan is ready.
        reason: Reason why the plan is void or missing.
        plan_hash: SHA-256 of the inputs and the content of the plan; empty without a plan.
        duration_s: Duration of the work (s). A point that is not rolled out yet counts as the mean of the others.
        points: Points in the order of work, then the refused points.
    """

    header: Header
    state: PlanState
    reason: Reason | None = None
    plan_hash: Digest = ""
    duration_s: NonNegative = 0.0
    points: tuple[PointPlan, ...] = ()


PreviewPhase = Literal["none", "waiting", "rolling", "ready", "approved", "expired"]


class PreviewState(Message, frozen=True, kw_only=True):
    """Controller → all: state, figures and approval of the preview.

    Attributes:
        header: `frame_id` is map.
        required: True if a cut needs an approved preview.
        phase: `waiting` for the robot to rest and for the plan; `rolling` while it is computed; `ready` for approval;
            `approved`; `expired` after a change.
        reason: The change that expired it, or the cause of waiting.
        preview_hash: SHA-256 of the inputs and the content of the preview; empty without a preview.
        approved_by: Name of the person who approved it; empty without an approval.
        start: Pose of base_link in map at the start.
        position: Actuated coordinates at the start (rad).
        duration_s: Duration of the preview (s).
        cuts: Points in the order of work.
        remaining: Number of accepted points after these that are not part of the preview.
    """

    header: Header
    required: bool
    phase: PreviewPhase
    reason: Reason | None = None
    preview_hash: Digest = ""
    approved_by: Text = ""
    start: PlanarPose | None = None
    position: Actuated | None = None
    duration_s: NonNegative = 0.0
    cuts: tuple[PreviewedCut, ...] = ()
    remaining: Count = 0


class PreviewRow(Struct, frozen=True, forbid_unknown_fields=True):
    """One sample of a preview.

    Attributes:
        time: Time from the start (s).
        base: Pose of base_link in map.
        position: Actuated coordinates (rad).
        tool: Position of the tool in map (m).
    """

    time: NonNegative
    base: PlanarPose
    position: Actuated
    tool: Vector3


class PreviewMotion(Message, frozen=True, kw_only=True):
    """Controller → server: the motion of a preview, for the ghost in the 3-D view.

    Attributes:
        header: `frame_id` is map.
        preview_hash: Hash of the preview, see `PreviewState`.
        rows: Samples of the motion.
    """

    header: Header
    preview_hash: Digest
    rows: tuple[PreviewRow, ...] = ()


_Number = Annotated[int, Meta(ge=0, le=100000)]


class CutReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One cut with its outcome, or a point that was given up before the order to cut.

    Attributes:
        cut_id: Id of the cut; empty for a point that was given up before.
        point_id: Point of the cut.
        vine: Number of its vine.
        spur: Number of its spur on that vine.
        outcome: Current outcome; empty during the cut.
        reason: Reason for the outcome; None without one.
        user: Who accepted the point.
        ended_at: Time of its end (s since 1970); 0 during the cut.
        seconds: Time from the previous order to cut, or from a later start of work, to the order for this cut (s). For
            a point that was given up before its order: to the time when it was given up.
        wrong_by: Who has said that it was wrong; empty without anyone.
    """

    cut_id: ClientKey = ""
    point_id: Name
    vine: _Number
    spur: _Number
    outcome: Outcome = ""
    reason: Reason | None = None
    user: Text = ""
    ended_at: WallTime = 0.0
    seconds: NonNegative = 0.0
    wrong_by: Text = ""


class VineReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Cuts of one vine by outcome.

    Attributes:
        vine: Number of the vine.
        done: Cuts with outcome DONE.
        not_cut: Cuts with outcome FAILED_NOT_CUT.
        unknown: Cuts with outcome UNKNOWN.
        unreachable: Accepted points that the plan refuses.
        seconds: Total time of the cuts (s).
    """

    vine: _Number
    done: Count = 0
    not_cut: Count = 0
    unknown: Count = 0
    unreachable: Count = 0
    seconds: NonNegative = 0.0


class RefusalReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A refused request.

    Attributes:
        at: Time (s since 1970).
        user: Who asked.
        asked: Name of the command.
        reason: Reason for the refusal.
    """

    at: WallTime
    user: Text
    asked: Name
    reason: Reason


class ControlReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A change of control: taken, granted or returned.

    Attributes:
        at: Time (s since 1970).
        user: Who acted.
        asked: Name of the command.
    """

    at: WallTime
    user: Text
    asked: Name


class SessionReport(Message, frozen=True, kw_only=True):
    """Controller → all: cuts, refusals and changes of control since the controller started, as recorded on disk.

    Attributes:
        began_at: Start of the controller (s since 1970).
        written_at: Time of the newest ledger row in the report (s since 1970).
        cuts: The newest cuts, oldest first.
        cut_count: Number of all cuts.
        vines: Every vine with a cut or an unreachable point, sorted by number.
        refusals: The newest refusals.
        refusal_count: Number of all refusals.
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


class TimelineEvent(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Something that has happened in a session.

    Attributes:
        at: Time (s since 1970).
        kind: Change of mode, cut, cut that did not end as wanted, or refused command.
        reason: What has happened, as in the log.
        before: Mode before a change of mode; empty otherwise.
        mode: Mode after a change of mode; empty otherwise.
    """

    at: WallTime
    kind: Literal["mode", "cut", "failed_cut", "refusal"]
    reason: Reason
    before: Mode | Literal[""] = ""
    mode: Mode | Literal[""] = ""


#: Largest number of events in the message.
TIMELINE_EVENTS = 500


class Timeline(Message, frozen=True, kw_only=True):
    """Controller or replay → server: what has happened in a session; a replay tells the whole recording.

    Attributes:
        began_at: Begin of the session (s since 1970); 0 before its first record.
        ended_at: Its newest record, or the end of the recording (s since 1970).
        events: The newest events, oldest first.
        left_out: Number of older events.
    """

    began_at: WallTime
    ended_at: WallTime
    events: Annotated[tuple[TimelineEvent, ...], Meta(max_length=TIMELINE_EVENTS)] = ()
    left_out: Count = 0


JointVelocity = Annotated[float, Meta(ge=-10.0, le=10.0)]
#: Fraction of the usual speed of motion by hand.
SpeedScale = Annotated[float, Meta(ge=0.05, le=1.0)]
ArmVelocities = tuple[
    JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity
]


class BaseVelocity(Struct, frozen=True, forbid_unknown_fields=True):
    """Velocity of the base.

    Attributes:
        linear: Forward velocity (m/s).
        angular: Yaw rate (rad/s).
    """

    linear: Annotated[float, Meta(ge=-2.0, le=2.0)]
    angular: Annotated[float, Meta(ge=-4.0, le=4.0)]


#: Frame whose axes a motion by hand, and the gizmo's arrows, follow.
GizmoAxes = Literal["tool", "base", "world"]
_Speed = Annotated[float, Meta(ge=-2.0, le=2.0)]


class ToolVelocity(Struct, frozen=True, forbid_unknown_fields=True):
    """Velocity of the tool along and about the axes of a frame, as these were when the hold began.

    Attributes:
        linear: Along x, y and z (m/s).
        angular: About x, y and z, at the tool (rad/s).
        axes: Frame of the axes.
        duration_s: The motion ends after so long at full speed (s), a step; without it only the hold ends it.
    """

    linear: tuple[_Speed, _Speed, _Speed]
    angular: tuple[_Speed, _Speed, _Speed]
    axes: GizmoAxes = "tool"
    duration_s: Annotated[float, Meta(ge=0.0, le=60.0)] | None = None


class TeleopTarget(Message, frozen=True, kw_only=True):
    """Server → controller while the operator holds a control: target of the motion by hand.

    With `target` alone the tool follows the target, with base and arm. With `target` and `base` the tool stays at the
    target while the base moves, as far as the arm allows. With `base` alone the arm rests, with `joints` the base. With
    `along` the tool moves along an axis, with `posture` the arm goes to a posture, straight in its joints.

    Attributes:
        sequence: Strictly increasing; a lower one is refused until the hold has ended by timeout.
        hold: False ends the hold at once; a timeout ends it too.
        user: Who holds.
        target: Desired T_odom_tool.
        base: Velocity of the base.
        joints: Velocities of the arm's joints (7, rad/s).
        along: Velocity of the tool.
        posture: Angles of the arm's joints to go to (7, rad).
        client: Key of the client, to distinguish clients of one user.
        speed_scale: Fraction of the usual speed.
        round_trip_s: Round-trip time between server and page, measured by the server (s).
    """

    sequence: Count
    hold: bool
    user: Text
    target: Pose | None = None
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    along: ToolVelocity | None = None
    posture: ArmAngles | None = None
    client: Annotated[str, Meta(max_length=64)] = ""
    speed_scale: SpeedScale = 1.0
    round_trip_s: NonNegative = 0.0
