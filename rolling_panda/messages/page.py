"""What the server and the page say to each other over `/ws`, as JSON; `web/js/link/messages.*` are made from it."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.perception import PruningPoint, PruningRule, UndecidedSite
from rolling_panda.messages.robot import BridgeState, JointState
from rolling_panda.messages.supervision import (
    ArmVelocities,
    BaseVelocity,
    ClientKey,
    ControllerState,
    ControlState,
    PlanState,
    PointPlan,
    PreviewState,
    QueueEntry,
    ReplayState,
    SpeedScale,
    StopState,
)
from rolling_panda.messages.types import (
    Angle,
    Count,
    Digest,
    NonNegative,
    PlanarPose,
    Process,
    Role,
    Severity,
    Text,
    UnitVector3,
    Vector3,
)

Age = Annotated[float, Meta(ge=0.0, le=1e9)]
#: Whose axes the gizmo's arrows lie along.
GizmoAxes = Literal["tool", "base", "world"]
CameraPreset = Literal["follow", "row", "tool", "top"]
#: What the 3-D view can show: vines as perceived, pruning points, the tool's trail, the camera on the hand and what it
#: sees, the points of its depth, and the simulated row as it really is.
Layer = Literal["plant", "points", "trail", "camera", "cloud", "simulated"]


class PageMessage(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of the page's messages: an object with a `type`; unknown fields are refused."""


class ProcessPresence(Struct, frozen=True, forbid_unknown_fields=True):
    """Is a process connected, and how old is its last word (s; None before the first)."""

    process: Process
    present: bool
    age_s: Age | None


class PageState(PageMessage, frozen=True, kw_only=True):
    """10 Hz: everything that changes all the time. The last known state stays, with its age.

    Attributes:
        number: Grows by one a message; the page echoes the last one it rendered.
        user: Who is signed in on this page.
        role: What they may do.
        viewers: Pages open now.
        processes: One row a process.
        controller: Its newest state, None before the first. Without its queue, which is in `PagePoints`.
        controller_age_s: Age of it (s).
        bridge: Its newest state.
        bridge_age_s: Age of it (s).
        joints: Newest joint state: speeds for the gauges.
        base: Base pose in odom.
        camera_frame: Sequence of the newest camera frame, to fetch `/camera/color.jpg?n=…`.
        client: The reader's own key, to be compared with the holder's.
        control: Who holds control of the robot's motion.
        stops: What bridge and controller hold latched.
        speed_ratios: Speed of each actuator in parts of its limit, wheels first; empty before the first joint state.
        replay: The recording that is played; None with a robot.
        relaxed_limits: Safety limits that a process's configuration sets less strictly than usual.
        plain_wire: The robot's wire is not protected: every program on its machine can move it.
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
    relaxed_limits: tuple[Text, ...] = ()
    plain_wire: bool = False


class PagePoint(Struct, frozen=True, forbid_unknown_fields=True):
    """One row of the queue: the point as perceived and its life in the controller's queue.

    `pixel` is its place in the newest camera image (px, None when outside), `cane_angle` the direction of the cane in
    that image (rad, from rightwards to downwards), for drawing. `plan` is what the session's plan says of it, None
    where no plan that holds does.
    """

    point: PruningPoint
    entry: QueueEntry
    pixel: tuple[float, float] | None = None
    cane_angle: Angle | None = None
    plan: PointPlan | None = None


class PagePlan(Struct, frozen=True, forbid_unknown_fields=True):
    """The session's plan in brief: whether it holds or why not, its hash, and how long it takes (s)."""

    state: PlanState
    reason: Text
    plan_hash: Digest
    duration_s: NonNegative


class PagePoints(PageMessage, frozen=True, kw_only=True):
    """Sent when it changed: every point in the order of work, and the undecided sites."""

    points: tuple[PagePoint, ...]
    undecided_sites: tuple[UndecidedSite, ...]
    segmenter: Text
    frames: Count
    image_size: tuple[int, int]
    plan: PagePlan | None = None
    rule: PruningRule | None = None


class PagePreview(PageMessage, frozen=True, kw_only=True):
    """Sent when the controller has said it: the preview, and whether it is approved."""

    preview: PreviewState


class PageEvent(Struct, frozen=True, forbid_unknown_fields=True):
    """A line of the log: `number` grows; `wall_time` is the server's clock (s since 1970), for people."""

    number: Count
    wall_time: float
    process: str
    severity: Severity
    text: str


class PageEvents(PageMessage, frozen=True, kw_only=True):
    """New lines of the log, oldest first; the last 200 at the start."""

    events: tuple[PageEvent, ...]


class Selected(PageMessage, frozen=True, kw_only=True):
    """A point was clicked in the 3-D view of this session; empty = nothing."""

    point_id: str


class PickRay(PageMessage, frozen=True, kw_only=True):
    """A click into the 3-D view of a session that places points: from `origin` along `direction` (odom, m)."""

    origin: Vector3
    direction: UnitVector3


class Measured(PageMessage, frozen=True, kw_only=True):
    """Of two places that were clicked while this session measures: second less first (m, odom), what is there."""

    offset: Vector3
    between: tuple[str, str]


class HoldEnded(PageMessage, frozen=True, kw_only=True):
    """The server has ended or refused what this page holds, and takes no more of it before the page lets go."""

    reason: Text


class Pong(PageMessage, frozen=True, kw_only=True):
    """Answer to a `Ping`, at once, for the round trip."""

    number: Count


class Ping(PageMessage, frozen=True, kw_only=True):
    """10 Hz: the page is alive, and `rendered` is the number of the last `PageState` it drew."""

    number: Count
    rendered: Count


class Hold(PageMessage, frozen=True, kw_only=True):
    """20 Hz while the operator holds: the tool may follow the gizmo. `hold` false, or silence, ends it.

    Attributes:
        sequence: Grows by one a message.
        hold: Whether they still hold.
        base: The base moves so, instead of the tool.
        joints: The arm's joints turn so (rad/s), instead of the tool.
        speed_scale: Of the usual speed.
    """

    sequence: Count
    hold: bool
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    speed_scale: SpeedScale = 1.0

    def __post_init__(self) -> None:
        """Refuse both at once."""
        if self.base is not None and self.joints is not None:
            raise ValueError("either the base moves or the joints turn: leave out one of them")


class ShowGizmo(PageMessage, frozen=True, kw_only=True):
    """Show or hide this session's gizmo in the 3-D view; shown, it starts at the tool, along these axes."""

    visible: bool
    axes: GizmoAxes = "tool"


class PlaceByHand(PageMessage, frozen=True, kw_only=True):
    """From now on clicks into the 3-D view are meant for new points, each answered with a `PickRay`; or no more."""

    active: bool


class ShowPreview(PageMessage, frozen=True, kw_only=True):
    """Show this moment of the preview in the 3-D view (s from its start); None = nothing of it."""

    time: NonNegative | None


class PlaceCamera(PageMessage, frozen=True, kw_only=True):
    """Put the camera of this session's 3-D views here; `follow` goes along with the base from then on."""

    preset: CameraPreset


class ShowLayers(PageMessage, frozen=True, kw_only=True):
    """Show these layers on this session's 3-D views, and no others."""

    layers: Annotated[tuple[Layer, ...], Meta(max_length=20)]


class Measure(PageMessage, frozen=True, kw_only=True):
    """From now on clicks into the 3-D view measure, each second one answered with `Measured`; or no more."""

    active: bool


class Select(PageMessage, frozen=True, kw_only=True):
    """Highlight a point in the 3-D view and bring this session's cameras there; empty = none.

    Attributes:
        point_id: Of the point.
        follow: The page follows the work, and nobody has chosen: who has just moved a camera keeps it for a while.
    """

    point_id: Annotated[str, Meta(max_length=64)]
    follow: bool = False


FromServer = PageState | PagePoints | PagePreview | PageEvents | Selected | PickRay | Measured | HoldEnded | Pong
FromPage = Ping | Hold | ShowGizmo | PlaceByHand | PlaceCamera | ShowLayers | Measure | ShowPreview | Select
