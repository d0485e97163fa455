"""What a whole-body method is asked for, and what it answers."""

from dataclasses import dataclass
from typing import Protocol

from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import Kinematics


@dataclass(frozen=True)
class Task:
    """A velocity wanted of some part of the robot.

    Attributes:
        name: For the log.
        jacobian: J (k×9) over ξ̇.
        target: J ξ̇ wanted (k).
    """

    name: str
    jacobian: Array
    target: Array


@dataclass(frozen=True)
class Demand:
    """One control period's problem.

    Attributes:
        q: Configuration (12).
        kinematics: Of the tool at q.
        tool: First priority: ẋ_d + K e.
        posture: Velocity over ξ (9) wanted in the null space by posture tasks: our addition to the paper's c1 + c2.
        base_frozen: True in the last centimetres, where only the arm moves.
    """

    q: Array
    kinematics: Kinematics
    tool: Task
    posture: Array
    base_frozen: bool


@dataclass(frozen=True)
class Solution:
    """What a method answers: ξ̇ before saturation (9) and the arm's manipulability."""

    xi: Array
    manipulability: float


class Method(Protocol):
    """A whole-body method; stateless between calls."""

    name: str

    def solve(self, demand: Demand) -> Solution:
        """The actuator velocities that answer the demand; not yet limited.

        Raises:
            ControlError: The demand has no answer, for example because it is not finite.
        """
        ...
