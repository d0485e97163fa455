"""Problem and solution of a whole-body method, and the interfaces of methods, guards and tasks."""

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal, Protocol

import numpy as np
from msgspec import Struct, field

from controller.whole_body.compiled import MATRIX, NUMBER, VECTOR, compiled
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import Kinematics

BaseMode = Literal["row", "free", "transit", "frozen"]
"""What the base is for.

`row`: it follows the posture's place and heading, and the arm takes the rest. `free`: it keeps the posture's heading;
where it stands follows from the tool. `transit`: the tool's sideways motion steers it, so the tool is kept ahead of the
axle. `frozen`: it comes to rest and stays.
"""


class ToolTask(Struct, frozen=True):
    """First priority: a twist of the tool.

    Attributes:
        twist: ẋ_d + K e (6): [v; ω] at the tool in odom's axes (m/s, rad/s).
        free_axis: True leaves the rotation about the tool's y, the cane's axis, to the lower priorities.
        keep_path: True slows the whole twist if the limits do not allow its speed; False gives the nearest feasible
            twist.
        ahead: Pose (T_odom_tool, pin.SE3) that the motion wants so many seconds later on its clock, at its end for
            infinity; None for a twist alone. Of use to a method that looks ahead.
    """

    twist: Array
    free_axis: bool = False
    keep_path: bool = True
    ahead: Callable[[float], Any] | None = None


class ActuatorTask(Struct, frozen=True):
    """First priority in place of the tool: velocities of the actuators, slowed as a whole if the limits require it.

    Attributes:
        xi: Desired ξ̇ (9, rad/s).
    """

    xi: Array
    keep_path: ClassVar[bool] = True


class Posture(Struct, frozen=True):
    """Desired posture of base and arm, with lower priority than the tool.

    Attributes:
        q: Desired configuration now (12); the wheels' entries are not used.
        rate: Its rate (12).
        goal: Configuration at the end of the motion (12); None without an end.
    """

    q: Array
    rate: Array = field(default_factory=lambda: np.zeros(NQ))
    goal: Array | None = None


class IkProblem(Struct, frozen=True):
    """Problem of one control period.

    Attributes:
        q: Configuration (12).
        kinematics: Kinematics of the tool at q.
        sent: Last command ξ̇ (9).
        tool: First priority: the tool's twist, or velocities of the actuators.
        posture: Last priority.
        base: Role of the base.
        speed_cap: Largest speed of the tool's origin (m/s).
        wheel_cap: Largest speed of each wheel on the ground (m/s); used by the method `hierarchy`.
        scale: Rate of the motion's clock in the last period, 0…1.
        before: Command ξ̇ before the last (9); None without acceleration.
        held: Measured wheel velocities (2, rad/s) in a period that solves for the arm only and keeps the wheels'
            command; None in other periods.
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
        # A number whose square overflows is invalid too.
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


#: What holds the robot back where a number of the problem, or its answer, is not finite.
NOT_FINITE = "a number that is not finite"


class Solution(Struct, frozen=True):
    """Solution of a method.

    Attributes:
        xi: ξ̇ to send (9), within every limit of velocity, acceleration and joint position.
        scale: Rate of the motion's clock, 0…1.
        manipulability: ω of the arm.
        feasible: False if the problem is infeasible: the robot brakes, or a constraint is relaxed.
        reason: Name of what holds the robot back, also if the tool slides along it; empty without one.
    """

    xi: Array
    scale: float
    manipulability: float
    feasible: bool = True
    reason: str = ""


class Inequalities(Struct, frozen=True):
    """Rows A ξ̇ ≥ lower with priority over the tool's task: A (k×9), lower (k), and the name of each row."""

    A: Array
    lower: Array
    names: tuple[str, ...]


NO_ROWS = Inequalities(np.zeros((0, NXI)), np.zeros(0), ())


class Guard(Protocol):
    """A source of inequalities; stateless between calls."""

    name: str

    def rows(self, problem: IkProblem) -> Inequalities:
        """Constraints of this period."""
        ...


class Method(Protocol):
    """A whole-body method; stateless between calls.

    `flows` is False if base and tool have to rest between the segments of a motion.
    """

    name: str
    flows: bool

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem, within the limits. Raises nothing for any numbers in it."""
        ...


class SecondaryTask(Protocol):
    """Desired velocity of a part of the robot, in the null space of the tool's task.

    Attributes:
        name: Name of the task.
        rows: Number of its rows.
    """

    name: str
    rows: int

    def prepare(self, jacobian: Array) -> None:
        """Write the constant entries. Called once, with zeros."""
        ...

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write √weight · J (rows×9, over ν) and √weight · target (rows).

        `jacobian` and `target` are the task's own places in the stack of all tasks, kept from period to period: what a
        task never writes stays zero.
        """
        ...
