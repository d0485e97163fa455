"""Messages between server and page over `/ws`, as JSON. `web/js/link/messages.*` are generated from them."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.perception import PruningPoint, PruningRule, UndecidedSite
from rolling_panda.messages.robot import BridgeState, JointState
from rolling_panda.messages.supervision import (
    ArmAngles,
    ArmVelocities,
    BaseVelocity,
    ClientKey,
    ControllerState,
    ControlState,
    GizmoAxes,
    PlanState,
    PointPlan,
    PreviewState,
    QueueEntry,
    ReplayState,
    SpeedScale,
    StopState,
    ToolVelocity,
)
from rolling_panda.messages.types import (
    Angle,
    Count,
    Digest,
    NonNegative,
    PlanarPose,
    Process,
    Program,
    Reason,
    Role,
    Severity,
    Text,
    UnitVector3,
    Vector3,
    WallTime,
)

Age = Annotated[float, Meta(ge=0.0, le=1e9)]
CameraPreset = Literal["follow", "row", "tool", "top"]
#: Layers of the 3-D view: perceived vines, pruning points, the tool's trail, the hand camera with its image, its depth
#: as a point cloud, and the simulated row.
Layer = Literal["plant", "points", "trail", "camera", "cloud", "simulated"]


class PageMessage(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Base of the page's messages: an object with a `type`; unknown fields are refused."""


class ProcessPresence(Struct, frozen=True, forbid_unknown_fields=True):
    """Connection of a process.

    Attributes:
        process: The process.
        present: Whether it is connected.
        age_s: Age of its last message (s); None before the first.
    """

    process: Process
    present: bool
    age_s: Age | None


class PageState(PageMessage, frozen=True, kw_only=True):
    """10 Hz: state of the robot. The last known state stays, with its age.

    Attributes:
        number: Increases by one with each message; the page echoes the last one it rendered.
        user: Name of the user of this page.
        role: Role of the user.
        viewers: Number of open pages.
        processes: Connection of each process.
        controller: Newest controller state, without its queue, which is in `PagePoints`; None before the first.
        controller_age_s: Age of that state (s).
        bridge: Newest bridge state; None before the first.
        bridge_age_s: Age of that state (s).
        joints: Newest joint state.
        base: Pose of base_link in odom.
        camera_frame: Sequence of the newest camera frame, to fetch `/camera/color.jpg?n=…`.
        client: Key of this page, to be compared with the holder's.
        control: Lease on the robot's motion.
        stops: Latched stops of bridge and controller.
        speed_ratios: Speed of each actuator as a fraction of its limit, wheels first; empty before the first joint
            state.
        replay: The recording that is replayed; None with a robot.
        relaxed_limits: Safety limits that a process's configuration sets less strictly than usual.
        camera_warning: What is wrong with the calibration of the camera; None if nothing is known.
        plain_wire: True if the wire has no TLS: every program on the robot's machine can move it.
    """

    number: Count
    user: Text
    role: Role
    viewers: Count
    processes: tuple[ProcessPresence, ...]
    controller: ControllerState | None
    controller_age_s: Age | None
    bridge: BridgeState | None
    bridge_age_s: Age | None
    joints: JointState | None
    base: PlanarPose | None
    camera_frame: Count
    client: ClientKey = ""
    control: ControlState | None = None
    stops: tuple[StopState, ...] = ()
    speed_ratios: tuple[NonNegative, ...] = ()
    replay: ReplayState | None = None
    relaxed_limits: tuple[Reason, ...] = ()
    plain_wire: bool = False
    camera_warning: Reason | None = None


class PagePoint(Struct, frozen=True, forbid_unknown_fields=True):
    """One row of the queue.

    Attributes:
        point: The point as perceived.
        entry: The point in the controller's queue.
        pixel: Its position in the newest camera image (px, column and row); None outside the image.
        cane_angle: Direction of the cane in that image (rad, from right to down).
        plan: The plan for the point; None without a valid plan.
    """

    point: PruningPoint
    entry: QueueEntry
    pixel: tuple[float, float] | None = None
    cane_angle: Angle | None = None
    plan: PointPlan | None = None


class PagePlan(Struct, frozen=True, forbid_unknown_fields=True):
    """Summary of the plan.

    Attributes:
        state: As in `SessionPlan`.
        reason: As in `SessionPlan`.
        plan_hash: As in `SessionPlan`.
        duration_s: Duration of the work, including the cuts (s).
    """

    state: PlanState
    reason: Reason | None
    plan_hash: Digest
    duration_s: NonNegative


class PagePoints(PageMessage, frozen=True, kw_only=True):
    """Sent on change: all points in the order of work, and the undecided sites.

    Attributes:
        points: All points.
        undecided_sites: Spurs without a point.
        segmenter: Name of the segmenter.
        frames: Number of camera frames used so far.
        image_size: Width and height of the camera image (px).
        plan: Summary of the plan.
        rule: Current pruning rule.
    """

    points: tuple[PagePoint, ...]
    undecided_sites: tuple[UndecidedSite, ...]
    segmenter: Text
    frames: Count
    image_size: tuple[int, int]
    plan: PagePlan | None = None
    rule: PruningRule | None = None


class PagePreview(PageMessage, frozen=True, kw_only=True):
    """Sent on change: the preview and its approval.

    Attributes:
        preview: State of the preview.
    """

    preview: PreviewState


class PageEvent(Struct, frozen=True, forbid_unknown_fields=True):
    """A line of the log.

    Attributes:
        number: Increases by one with each line.
        wall_time: Wall clock of the server (s since 1970).
        process: Process that the line is from.
        severity: Severity.
        text: The line in English, for scripts.
        reason: The line as data, which the page renders; null for a line of the page's own.
    """

    number: Count
    wall_time: float
    process: str
    severity: Severity
    text: str
    reason: Reason | None = None


class PageEvents(PageMessage, frozen=True, kw_only=True):
    """New lines of the log.

    Attributes:
        events: Lines, oldest first. A new page gets the last 200.
    """

    events: tuple[PageEvent, ...]


class TopicTraffic(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A topic of the wire, and its messages as the server receives them.

    Attributes:
        name: Name of the topic.
        sender: Publishing processes, separated by commas, or "any".
        nominal_hz: Rate by the topic table; 0 on event.
        received: Whether the server subscribes to it; the figures below are of what it receives.
        count: Number of messages.
        rate_hz: Mean rate of the newest messages; None before the second.
        age_s: Age of the newest message (s); None before the first.
        rejected: Number of messages that could not be read.
    """

    name: str
    sender: str
    nominal_hz: NonNegative
    received: bool
    count: Count = 0
    rate_hz: NonNegative | None = None
    age_s: Age | None = None
    rejected: Count = 0


class Diagnostics(PageMessage, frozen=True, kw_only=True):
    """Answer of `/api/diagnostics`.

    Attributes:
        wall_time: Time of the answer by the server's clock (s since 1970).
        programs: Program of each process that has told it.
        topics: Every topic of the wire.
    """

    wall_time: WallTime
    programs: tuple[Program, ...]
    topics: tuple[TopicTraffic, ...]


class Selected(PageMessage, frozen=True, kw_only=True):
    """A point was clicked in the 3-D view of this session.

    Attributes:
        point_id: The point; empty for none.
    """

    point_id: str


class PickRay(PageMessage, frozen=True, kw_only=True):
    """A click in the 3-D view while points are placed by hand.

    Attributes:
        origin: Origin of the pick ray in map (m).
        direction: Unit direction of the pick ray in map.
    """

    origin: Vector3
    direction: UnitVector3


class Measured(PageMessage, frozen=True, kw_only=True):
    """Result of a measurement between two clicks in the 3-D view.

    Attributes:
        offset: Second position minus the first, in map (m).
        between: Names of the clicked objects.
    """

    offset: Vector3
    between: tuple[str, str]


class HoldEnded(PageMessage, frozen=True, kw_only=True):
    """The server has ended or refused the hold of this page. The page has to release before it can hold again.

    Attributes:
        reason: Why.
    """

    reason: Reason


class Pong(PageMessage, frozen=True, kw_only=True):
    """Immediate answer to a `Ping`, to measure the round trip.

    Attributes:
        number: `number` of the `Ping`.
    """

    number: Count


class Ping(PageMessage, frozen=True, kw_only=True):
    """10 Hz: the page is alive.

    Attributes:
        number: Chosen by the page; the `Pong` repeats it.
        rendered: `number` of the last `PageState` that the page drew.
    """

    number: Count
    rendered: Count


class Hold(PageMessage, frozen=True, kw_only=True):
    """20 Hz while the operator holds a control. Without any of the four motions the tool follows the gizmo.

    Attributes:
        sequence: Increases by one with each message.
        hold: False ends the hold at once; a timeout ends it too.
        base: Velocity of the base.
        joints: Velocities of the arm's joints (7, rad/s).
        along: Velocity of the tool.
        posture: Angles of the arm's joints to go to (7, rad).
        speed_scale: Fraction of the usual speed.
    """

    sequence: Count
    hold: bool
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    along: ToolVelocity | None = None
    posture: ArmAngles | None = None
    speed_scale: SpeedScale = 1.0

    def __post_init__(self) -> None:
        """Refuse several at once."""
        if sum(each is not None for each in (self.base, self.joints, self.along, self.posture)) > 1:
            raise ValueError("base, joints, along and posture are different motions: leave out all but one of them")


class ShowGizmo(PageMessage, frozen=True, kw_only=True):
    """Show or hide the gizmo of this session.

    Attributes:
        visible: Whether to show it. It appears at the tool.
        axes: Frame whose axes it follows.
    """

    visible: bool
    axes: GizmoAxes = "tool"


class PlaceByHand(PageMessage, frozen=True, kw_only=True):
    """Switch placing of points by hand.

    Attributes:
        active: While true, each click in the 3-D view is answered with a `PickRay`.
    """

    active: bool


class ShowPreview(PageMessage, frozen=True, kw_only=True):
    """Show the preview in the 3-D view at one moment.

    Attributes:
        time: Time from the start of the preview (s); None hides it.
    """

    time: NonNegative | None


class ShowPosture(PageMessage, frozen=True, kw_only=True):
    """Show the arm in another posture, see-through, in this session's 3-D views.

    Attributes:
        angles: Angles of the arm's joints (7, rad); None hides it.
    """

    angles: ArmAngles | None


class PlaceCamera(PageMessage, frozen=True, kw_only=True):
    """Place the camera of this session's 3-D views.

    Attributes:
        preset: View; `follow` moves with the base.
    """

    preset: CameraPreset


class ShowLayers(PageMessage, frozen=True, kw_only=True):
    """Choose the layers of this session's 3-D views.

    Attributes:
        layers: Layers to show; all others are hidden.
    """

    layers: Annotated[tuple[Layer, ...], Meta(max_length=20)]


class Measure(PageMessage, frozen=True, kw_only=True):
    """Switch measuring.

    Attributes:
        active: While true, every second click in the 3-D view is answered with `Measured`.
    """

    active: bool


class Select(PageMessage, frozen=True, kw_only=True):
    """Highlight a point in the 3-D view and move this session's cameras there.

    Attributes:
        point_id: The point; empty for none.
        follow: True if the page follows the work. A camera that a person has just moved then stays for a while.
    """

    point_id: Annotated[str, Meta(max_length=64)]
    follow: bool = False


FromServer = PageState | PagePoints | PagePreview | PageEvents | Selected | PickRay | Measured | HoldEnded | Pong
FromPage = (
    Ping | Hold | ShowGizmo | PlaceByHand | PlaceCamera | ShowLayers | Measure | ShowPreview | ShowPosture | Select
)
