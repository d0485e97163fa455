"""Problem and solution of a whole-body method, and the interfaces of methods, guards and tasks."""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Protocol

import numpy as np
from msgspec import Struct

from controller.whole_body.compiled import MATRIX, NUMBER, VECTOR, compiled
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import Kinematics

BaseMode = Literal["row", "free", "transit", "frozen"]
"""What the base is for.

`row`: it follows the posture's place and heading, and the arm takes the rest. `free`: it keeps the posture's heading;
where it stands follows from the tool. `transit`: the tool's sideways motion steers it, so the tool is kept ahead of the
axle. `frozen`: it comes to rest and stays.
"""


@dataclass(frozen=True)
class ToolTask:
    """First priority: a twist of the tool.

    Attributes:
        twist: ẋ_d + K e (6): [v; ω] at the tool in odom's axes (m/s, rad/s).
        free_axis: True leaves the rotation about the tool's y, the cane's axis, to the lower priorities.
        keep_path: True slows down as a whole where the limits do not let the tool be as fast as asked; False answers
            with the nearest possible twist.
    """

    twist: Array
    free_axis: bool = False
    keep_path: bool = True


@dataclass(frozen=True)
class ActuatorTask:
    """First priority instead of the tool's: the actuators' own velocities, slowed as a whole where they do not fit.

    Attributes:
        xi: ξ̇ wanted (9, rad/s).
    """

    xi: Array
    keep_path: ClassVar[bool] = True


@dataclass(frozen=True)
class Posture:
    """Where base and arm should be, as far as the tool lets them.

    Attributes:
        q: Configuration wanted now (12); the wheels' entries are not used.
        rate: Its rate (12).
        goal: Configuration at the end of the motion (12); None where there is no end.
    """

    q: Array
    rate: Array = field(default_factory=lambda: np.zeros(NQ))
    goal: Array | None = None


@dataclass(frozen=True)
class IkProblem:
    """One control period's problem.

    Attributes:
        q: Configuration (12).
        kinematics: Of the tool at q.
        sent: ξ̇ sent last (9).
        tool: First priority: the tool's twist, or the actuators' own velocities.
        posture: Last priority.
        base: What the base is for.
        speed_cap: Largest speed of the tool's origin (m/s).
        wheel_cap: Largest speed of each wheel on the ground (m/s); the method `hierarchy` keeps to it.
        scale: Rate of the motion's clock in the last period, 0…1.
        before: ξ̇ sent in the period before the last (9); None where nothing accelerates.
        held: Velocities that the wheels really have (2, rad/s) in a period in which only the arm is solved for and the
            wheels' command stays; None in the others.
    """

    q: Array
    kinematics: Kinematics
    sent: Array
    tool: ToolTask | ActuatorTask
    posture: Posture
    base: BaseMode = "row"
    speed_cap: float = math.inf
    scale: float = 1.0
    before: Array | None = None
    held: Array | None = None
    wheel_cap: float = math.inf

    @property
    def arm_only(self) -> bool:
        """Whether the base's velocity is given."""
        return self.base == "frozen" or self.held is not None

    @property
    def sent_before(self) -> Array:
        """ξ̇ sent in the period before the last (9)."""
        return self.sent if self.before is None else self.before

    @property
    def finite(self) -> bool:
        """Whether every number that a method uses is finite."""
        posture, J, tool = self.posture, self.kinematics.J, self.tool
        wanted = tool.twist if isinstance(tool, ToolTask) else tool.xi
        squares = _squares(self.q, self.sent, self.sent_before, wanted, posture.q, posture.rate, J)
        if self.held is not None:
            squares += self.held[0] ** 2 + self.held[1] ** 2
        # A square that overflows belongs to a number that is of no use either.
        return math.isfinite(squares) and not math.isnan(self.speed_cap + self.scale)


@compiled(NUMBER(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX))
def _squares(q: Array, sent: Array, before: Array, wanted: Array, posture: Array, rate: Array, J: Array) -> float:
    """Sum of the squares of every entry."""
    total = 0.0
    for vector in (q, sent, before, wanted, posture, rate):
        for entry in vector:
            total += entry * entry
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            total += J[i, j] * J[i, j]
    return total


class Solution(Struct, frozen=True):
    """What a method answers.

    Attributes:
        xi: ξ̇ to send (9), within every limit of velocity, acceleration and joint position.
        scale: Rate of the motion's clock, 0…1.
        manipulability: ω of the arm.
        feasible: False when the problem could not be answered: the robot brakes, or a constraint gives way.
        reason: What is in the way, in words; a hand that slides along it is told too. Empty where nothing is.
    """

    xi: Array
    scale: float
    manipulability: float
    feasible: bool = True
    reason: str = ""


class Inequalities(Struct, frozen=True):
    """Rows A ξ̇ ≥ lower that are kept before the tool's task: A (k×9), lower (k), and what each row is about."""

    A: Array
    lower: Array
    names: tuple[str, ...]


NO_ROWS = Inequalities(np.zeros((0, NXI)), np.zeros(0), ())


class Guard(Protocol):
    """A source of inequalities; stateless between calls."""

    name: str

    def rows(self, problem: IkProblem) -> Inequalities:
        """What has to hold in this period."""
        ...


class Method(Protocol):
    """A whole-body method; stateless between calls.

    `flows` is False where base and tool have to come to rest between the legs of a way.
    """

    name: str
    flows: bool

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem, within the limits. Raises nothing for any numbers in it."""
        ...


class SecondaryTask(Protocol):
    """A velocity that some part of the robot should have, as far as the tool's task leaves it free.

    Attributes:
        name: Of the task.
        rows: Number of its rows.
    """

    name: str
    rows: int

    def prepare(self, jacobian: Array) -> None:
        """Write what is the same in every period. Called once, with all zeros."""
        ...

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write √weight · J (rows×9, over ν) and √weight · target (rows).

        `jacobian` and `target` are the task's own places in the stack of all tasks, kept from period to period: what a
        task never writes stays zero.
        """
        ...
