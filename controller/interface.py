"""What goes into one control step and what comes out."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from controller.journal import LedgerState, Record
from controller.preview_plan import Preview, PreviewRequest
from controller.work_plan import PlanRequest, WorkPlan
from rolling_panda import messages as m
from rolling_panda.control_messages import ControlState, Presence, StopState
from rolling_panda.look_messages import CloseLook, PictureRequest
from rolling_panda.plan_messages import SessionPlan
from rolling_panda.preview_messages import PreviewMotion, PreviewState
from rolling_panda.row_messages import Obstacles
from rolling_panda.teleop_messages import TeleopTarget

Msg = TypeVar("Msg", bound=m.Message)


@dataclass(frozen=True)
class Sample(Generic[Msg]):
    """A message and when it came in (s, the clock of `now`)."""

    message: Msg
    at: float


@dataclass(frozen=True)
class Inputs:
    """The newest of everything; None where nothing has come yet.

    Attributes:
        joints: Measured wheels and arm.
        odometry: Base from its wheels.
        bridge: Latch, watchdog and cutter.
        points: What perception holds true.
        obstacles: What perception sees standing in the way.
        teleop: Where the held gizmo is.
        presence: Who is there.
        server_seen: When the server's newest heartbeat came in (s).
        perception_seen: The same of perception.
        present: Processes connected now.
        stops: Stop requests that came in since the last step.
        wall_time: Now (s since 1970), for people alone.
        plan: Newest answer of the planner.
        preview: Newest preview that was made.
        ledger: How much of what was recorded is durable.
        look: What the newest picture that was asked for shows.
        tick_s: Median time of one control step, measured by the loop (s).
        ticks: Control periods, counted by the loop.
        late_ticks: Those of them that lasted more than half as long again as they should.
    """

    joints: Sample[m.JointState] | None = None
    odometry: Sample[m.Odometry] | None = None
    bridge: Sample[m.BridgeState] | None = None
    points: Sample[m.PruningPoints] | None = None
    obstacles: Sample[Obstacles] | None = None
    teleop: Sample[TeleopTarget] | None = None
    presence: Sample[Presence] | None = None
    server_seen: float | None = None
    perception_seen: float | None = None
    present: frozenset[str] = frozenset()
    stops: tuple[m.StopRequest, ...] = ()
    wall_time: float = 0.0
    plan: WorkPlan | None = None
    preview: Preview | None = None
    ledger: LedgerState = LedgerState()
    look: Sample[CloseLook] | None = None
    tick_s: float = 0.0
    ticks: int = 0
    late_ticks: int = 0


@dataclass(frozen=True)
class Outputs:
    """What to send after one step; None or empty where nothing is due.

    `request` and `preview_request` go to the planner, `records` to the ledger.
    """

    motion: m.MotionCommand | None = None
    cut: m.CutCommand | None = None
    release: m.ReleaseStop | None = None
    state: m.ControllerState | None = None
    events: tuple[m.LogEvent, ...] = ()
    plan: SessionPlan | None = None
    request: PlanRequest | None = None
    records: tuple[Record, ...] = ()
    picture: PictureRequest | None = None
    control: ControlState | None = None
    stops: StopState | None = None
    preview: PreviewState | None = None
    preview_motion: PreviewMotion | None = None
    preview_request: PreviewRequest | None = None
