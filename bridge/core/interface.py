"""Interface of a robot: four methods, the same for the simulated and the real robot."""

from dataclasses import dataclass
from typing import Literal, Protocol

from bridge.core.attitude import Inertial
from bridge.core.picture import Picture
from rolling_panda import reasons
from rolling_panda.messages.types import Outcome, Reason
from rolling_panda.model.differential_drive import Array

CutterState = Literal["open", "closing", "opening", "jammed"]

NO_CUT = reasons.no_cut_yet()


@dataclass(frozen=True)
class Measurement:
    """Measured state of the robot: ξ and its rates over [θ_l, θ_r, q₁…q₇] (rad, rad/s), and the cutter.

    `detail` explains `outcome`; it is `NO_CUT` before the first cut. `fault` is the reason why the robot cannot move,
    None without one. A person has to release a `severe` fault.
    `external_torque` is the arm's own estimate of the torques by what touches it (7, N·m); None without one.
    `inertial` is the newest sample of the camera's inertial sensors; None without them.
    `emergency` tells whether the emergency stop button is pressed. `battery` is the charge (0…1), and `arm_success` the
    fraction of the arm's last 100 commands that arrived in time; None if unknown.
    """

    position: Array
    velocity: Array
    cutter: CutterState
    cut_id: str
    outcome: Outcome
    detail: Reason
    fault: Reason | None = None
    severe: bool = False
    emergency: bool = False
    battery: float | None = None
    arm_success: float | None = None
    external_torque: Array | None = None
    inertial: Inertial | None = None


@dataclass(frozen=True)
class Setpoint:
    """Setpoint of the actuators: ξ̇ (rad/s), whether the blades may close, and the token of the command.

    When `releases` increases, a person has released a stop, and the robot may recover from its fault.
    """

    xi: Array
    blades: bool
    epoch: int
    sequence: int
    at: float
    releases: int = 0


class Robot(Protocol):
    """A base, an arm, a cutter and a camera. Calls come from one thread."""

    def read(self) -> Measurement:
        """The newest measurement; does not wait."""

    def write(self, setpoint: Setpoint) -> None:
        """Actuate for one period of 1 ms, which passes meanwhile; without `blades` the cutter opens."""

    def cut(self, cut_id: str, point_id: str) -> None:
        """Begin to close the blades; how it ends is in later measurements."""

    def capture(self, expose: bool) -> Picture | None:
        """Take a picture now if `expose` is set; returns one that has become ready, each once."""

    def close(self) -> None:
        """Let go of the hardware; safe to call twice."""
