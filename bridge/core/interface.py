"""What a robot is to the bridge: four methods, the same for the simulated and the real one."""

from dataclasses import dataclass
from typing import Literal, Protocol

from bridge.core.picture import Picture
from rolling_panda.messages.types import Outcome
from rolling_panda.model.differential_drive import Array

CutterState = Literal["open", "closing", "opening", "jammed"]


@dataclass(frozen=True)
class Measurement:
    """What the robot's sensors say: ξ and its rates over [θ_l, θ_r, q₁…q₇] (rad, rad/s), and the cutter.

    `fault` is why the robot itself does not move, empty when it does; a `severe` one has to be released by a person.
    `emergency` is whether its emergency stop button is pressed; `battery` the charge (0…1), None when unknown.
    """

    position: Array
    velocity: Array
    cutter: CutterState
    cut_id: str
    outcome: Outcome
    detail: str
    fault: str = ""
    severe: bool = False
    emergency: bool = False
    battery: float | None = None


@dataclass(frozen=True)
class Setpoint:
    """What is really sent on: ξ̇ (rad/s), whether the blades may close, and the token that it follows from.

    When `releases` grows, a person has released a stop, and the robot may recover from what stopped it.
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
