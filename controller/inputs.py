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
    """A message and its arrival time (s, the clock of `now`)."""

    message: Msg
    at: float


@dataclass(frozen=True)
class Inputs:
    """Newest message of each topic; None before the first.

    Attributes:
        joints: Joint state.
        odometry: Odometry.
        bridge: Bridge state.
        points: Pruning points.
        obstacles: Obstacles.
        teleop: Target of motion by hand.
        presence: People who are present.
        server_seen: Arrival time of the server's newest heartbeat (s).
        perception_seen: Arrival time of perception's newest heartbeat (s).
        present: Connected processes.
        stops: Stop requests since the last step.
        wall_time: Wall clock (s since 1970), for texts only.
        ledger: Durability of the records.
        close_up: Result of the newest close-up.
        tick_s: Median duration of one control step, measured by the loop (s).
        ticks: Control periods, counted by the loop.
        late_ticks: Control periods that lasted more than 1.5 times their nominal length.
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
