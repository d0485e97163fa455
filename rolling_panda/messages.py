"""Every message on the wire: frozen, typed, SI units, strict.

Frames: REP-105 (`odom`, `base_link`, `tool`, `camera`). Quaternions say their order in the name. Fields have ROS's
names. A bound is part of a number's type, so decoding refuses NaN, infinity and what is out of range, never clamping.
"""

from typing import Annotated, Literal, get_args

from msgspec import Meta, Struct

SCHEMA_VERSION = 1

Finite = Annotated[float, Meta(ge=-1e9, le=1e9)]
Metre = Annotated[float, Meta(ge=-1e4, le=1e4)]
Unit = Annotated[float, Meta(ge=-1.001, le=1.001)]
NonNegative = Annotated[float, Meta(ge=0.0, le=1e9)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Angle = Annotated[float, Meta(ge=-1e6, le=1e6)]
Speed = Annotated[float, Meta(ge=-100.0, le=100.0)]
Count = Annotated[int, Meta(ge=0, le=2**62)]
#: Without the last part of the pattern a newline at the end would pass: "$" also matches before it.
Name = Annotated[str, Meta(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+(?!\n)$")]
Text = Annotated[str, Meta(max_length=500)]

Vector3 = tuple[Metre, Metre, Metre]
UnitVector3 = tuple[Unit, Unit, Unit]
QuatXyzw = tuple[Unit, Unit, Unit, Unit]
ArmVector = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle]
#: θ_l, θ_r, q₁…q₇ (rad): the actuated coordinates ξ.
Actuated = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle]
#: Velocities of ξ (rad/s).
ActuatedVelocity = tuple[Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed]

Role = Literal["viewer", "operator", "supervisor"]
Process = Literal["bridge", "controller", "perception", "server"]
PROCESSES: tuple[Process, ...] = ("bridge", "controller", "perception", "server")

Mode = Literal["IDLE", "READY", "TELEOP", "AUTO", "PAUSED", "PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]
Phase = Literal["", "APPROACH", "LOOK", "ADVANCE", "CUT", "RETREAT", "SURVEY"]
PointState = Literal["PROPOSED", "ACCEPTED", "INTENT", "DONE", "FAILED_NOT_CUT", "UNKNOWN", "REJECTED"]
Severity = Literal["info", "warning", "error"]
Outcome = Literal["", "DONE", "FAILED_NOT_CUT", "UNKNOWN"]
Need = Literal["another look", "operator"]
WoodClass = Literal[
    "background", "ground", "post", "trunk", "cordon", "spur", "cane", "node", "wire", "hose", "old cut"
]
#: Index = value in a label image.
WOOD_CLASSES: tuple[WoodClass, ...] = get_args(WoodClass)
BridgeKind = Literal["sim", "real", "fakes"]
CutKind = Literal["spur cut", "renewal cut", "cane cut", "by hand"]
Digest = Annotated[str, Meta(max_length=64, pattern=r"^[0-9a-f]*(?!\n)$")]
Covariance = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Message(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of the wire messages: a map with a `type` tag; unknown fields are refused."""


class Header(Struct, frozen=True, forbid_unknown_fields=True):
    """Who measured when: `stamp` is the sender's monotonic clock (s), for differences only, in frame `frame_id`."""

    stamp: Finite = 0.0
    frame_id: Annotated[str, Meta(max_length=64)] = ""


class Pose(Struct, frozen=True, forbid_unknown_fields=True):
    """A rigid placement: `position` (m) and `quat_xyzw` (unit) of a child frame in the frame that the owner names."""

    position: Vector3
    quat_xyzw: QuatXyzw


class PlanarPose(Struct, frozen=True, forbid_unknown_fields=True):
    """The base on the ground: `x`, `y` (m) and heading `phi` (rad) of base_link in odom."""

    x: Metre = 0.0
    y: Metre = 0.0
    phi: Angle = 0.0


class MotionCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: the velocity of every actuator, newest wins.

    Attributes:
        epoch: Counts starts of the controller and leases given, durably; an older one is refused.
        sequence: Strictly increasing within an epoch.
        echo: `sequence` of the newest `JointState` the command was computed from. The bridge knows when it sent that
            state, so it judges the command's age on its own clock.
        xi: [θ̇_l, θ̇_r, q̇₁…q̇₇] in rad/s.
        token: Random part of the lease's token; within an epoch another one is refused.
    """

    epoch: Count
    sequence: Count
    echo: Count
    xi: ActuatedVelocity
    token: Annotated[str, Meta(max_length=32)] = ""


class CutCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: close the blades once. Repeated until seen; the bridge acts on a `cut_id` once.

    `epoch`, `token` and `echo` are judged as those of a motion command, and the robot has to be at rest.
    """

    epoch: Count
    cut_id: Name
    point_id: Name
    echo: Count = 0
    token: Annotated[str, Meta(max_length=32)] = ""


class StopRequest(Message, frozen=True, kw_only=True):
    """Anyone → bridge and controller: the software stop, latched by both. Sent several times with one `stop_id`."""

    stop_id: Name
    source: Name
    user: Text
    reason: Text


class JointState(Message, frozen=True, kw_only=True):
    """Bridge → all: measured actuated coordinates, [θ_l, θ_r, q₁…q₇] (rad, rad/s), as sensor_msgs/JointState."""

    header: Header
    sequence: Count
    position: Actuated
    velocity: ActuatedVelocity


class Odometry(Message, frozen=True, kw_only=True):
    """Bridge → all: the base from its wheels.

    Attributes:
        header: `frame_id` is odom.
        sequence: Strictly increasing.
        pose: base_link in odom.
        linear: Forward velocity of the axle centre (m/s).
        angular: Yaw rate (rad/s).
    """

    header: Header
    sequence: Count
    pose: PlanarPose
    linear: Speed
    angular: Speed


class RejectionCount(Struct, frozen=True, forbid_unknown_fields=True):
    """How many messages of a topic were refused for one reason."""

    topic: Text
    reason: Text
    count: Count


class BridgeState(Message, frozen=True, kw_only=True):
    """Bridge → all: its own latch, watchdog and cutter; the controller cannot overrule any of them.

    Attributes:
        kind: `sim`, `real`, or `fakes`: the real robot's drivers with fakes in place of the devices.
        epoch: Newest controller epoch accepted.
        watchdog: True while no valid setpoint has come for the deadline: base 0, arm holds, cutter inhibited.
        stop_id: The latched software stop, empty when none.
        stopped_by: User and reason of that stop.
        cutter: What the blades do.
        cut_id: The last cut asked for, empty when none.
        outcome: How that cut ended, empty while it goes on.
        real_time_factor: Simulated seconds a second; 1 on a real robot.
        round_trip_s: From a joint state to the command that answers it, median over the last second; 0 without any.
        round_trip_worst_s: The longest of them.
        rejections: Messages refused since the start, by reason.
        battery: Charge of the base; None where nobody tells, as in the simulation.
    """

    header: Header
    kind: BridgeKind
    epoch: Count
    watchdog: bool
    stop_id: Annotated[str, Meta(max_length=64)]
    stopped_by: Text
    cutter: Literal["open", "closing", "opening", "jammed"]
    cut_id: Annotated[str, Meta(max_length=64)]
    outcome: Outcome
    real_time_factor: NonNegative
    round_trip_s: NonNegative = 0.0
    round_trip_worst_s: NonNegative = 0.0
    rejections: tuple[RejectionCount, ...] = ()
    battery: Fraction | None = None


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


class Nearness(Struct, frozen=True, forbid_unknown_fields=True):
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
        held_by: What keeps the robot from doing all that is asked of it now, by name; empty where nothing does.
        near: What it is nearest to touching while it moves; None where nothing is near.
        order: Whose order that is.
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
    held_by: Text = ""
    near: Nearness | None = None
    order: QueueOrder = QueueOrder()


class Heartbeat(Message, frozen=True, kw_only=True):
    """A process's loop is turning: `sequence` grows with each turn, not with each send."""

    process: Process
    sequence: Count
    status: Text = ""


class LogEvent(Message, frozen=True, kw_only=True):
    """Something a person should be able to read later: what happened, or why something was refused."""

    header: Header
    process: Process
    severity: Severity
    text: Text


class PruningPoint(Struct, frozen=True, forbid_unknown_fields=True):
    """Where to cut, and why.

    Attributes:
        point_id: Stable while the point is tracked from frame to frame.
        revision: Grows when what is cut changes: its kind, the nodes kept, or by more than noise its place or tangent.
        position: On the cane's axis, in odom (m).
        tangent: Unit vector along the cane, pointing away from the cordon, in odom.
        radius: Of the cane (m).
        confidence: 0…1.
        nodes_seen: Count nodes seen on the cane (the basal bud is not counted).
        nodes_kept: Count nodes that stay below the cut.
        vine: Number of the vine along the row, as perceived.
        spur: Number of the spur position on that vine, as perceived.
        reason: Why here, in one sentence a grower understands.
        kind: Shortens the cane that stays, takes the old stub off, tips the cane that will fruit, or is a person's.
        offset: Past the last kept node, along the cane (m); None where no kept node is below the cut.
        force: Predicted cutting force (N).
        wire_distance: To the surface of the nearest known wire (m); None while none is known.
        cordon_distance: The same for cordons.
        node_distance: To the nearest node that stays (m); None where none is known.
        digest: Hash of what is cut and where, as `rolling_panda.point_digest` makes it; one for each revision.
    """

    point_id: Name
    revision: Count
    position: Vector3
    tangent: UnitVector3
    radius: Annotated[float, Meta(gt=0.0, le=0.1)]
    confidence: Fraction
    nodes_seen: Annotated[int, Meta(ge=0, le=100)]
    nodes_kept: Annotated[int, Meta(ge=0, le=100)]
    vine: Annotated[int, Meta(ge=0, le=100000)]
    spur: Annotated[int, Meta(ge=0, le=100000)]
    reason: Text
    kind: CutKind = "spur cut"
    position_covariance: Covariance | None = None
    tangent_covariance: Covariance | None = None
    offset: Metre | None = None
    force: NonNegative = 0.0
    wire_distance: Finite | None = None
    cordon_distance: Finite | None = None
    node_distance: NonNegative | None = None
    digest: Digest = ""


class PruningRule(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Nodes kept on a spur, and on a Guyot vine's new cane; least diameter of a keeper (m); past the last node (m)."""

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    keeper_diameter: Annotated[float, Meta(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Meta(ge=0.005, le=0.05)] = 0.020


class Abstention(Struct, frozen=True, forbid_unknown_fields=True):
    """A place without a point: why, and what it needs. Without vine and spur (0) it is about no spur in particular.

    `position` is where the spur was seen (m, odom).
    """

    reason: Text
    needs: Need
    vine: Annotated[int, Meta(ge=0, le=100000)] = 0
    spur: Annotated[int, Meta(ge=0, le=100000)] = 0
    position: Vector3 | None = None


class PruningPoints(Message, frozen=True, kw_only=True):
    """Perception → all: every point it holds true now.

    Attributes:
        header: `frame_id` is odom.
        segmenter: Name of the segmenter behind it.
        frames: Camera frames used so far.
        points: All points.
        abstained: Places looked at without a point, over all frames.
        canes: Axis of each cane as perceived: polylines in odom (m).
        rule: In force; None where nobody says.
    """

    header: Header
    segmenter: Text
    frames: Count
    points: tuple[PruningPoint, ...]
    abstained: tuple[Abstention, ...] = ()
    canes: tuple[tuple[Vector3, ...], ...] = ()
    rule: PruningRule | None = None


class ReleaseStop(Message, frozen=True, kw_only=True):
    """Controller → bridge: release the latched stop `stop_id`. Moves nothing; any other id is refused."""

    stop_id: Name
    user: Text
    reason: Annotated[str, Meta(min_length=1, max_length=500)]


class Answer(Message, frozen=True, kw_only=True):
    """Reply of every service: done or not, and the reason in words."""

    ok: bool
    reason: Text = ""
