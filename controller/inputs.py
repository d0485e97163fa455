"""Latest inputs of a control step with their arrival times."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from controller.ledger.journal import LedgerState
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpResult, Obstacles
from rolling_panda.messages.supervision import Presence, TeleopTarget

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
        ledger: How much of what was recorded is durable.
        close_up: Result of the newest requested close-up.
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
    ledger: LedgerState = LedgerState()
    close_up: Sample[CloseUpResult] | None = None
    tick_s: float = 0.0
    ticks: int = 0
    late_ticks: int = 0
