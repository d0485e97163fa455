"""Task: the arm joints follow the posture."""

import numpy as np

from controller.whole_body.compiled import NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.task import IkProblem
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_XI


class ArmPosture:
    """q̇ = q̇_ref + gain (q_ref − q) for each joint of the arm."""

    name = "arm posture"
    rows = 7

    def __init__(self, weight: float, gain: float, speed: Array) -> None:
        """Scale by the joints' largest speeds.

        Args:
            weight: Against the other tasks.
            gain: Of the posture's error (1/s).
            speed: Largest ν (9).
        """
        self._gain, self._weight = gain, weight**0.5 / speed[ARM_XI]

    def prepare(self, jacobian: Array) -> None:
        """Each joint has a row of its own."""
        jacobian[:, ARM_XI] = np.diag(self._weight)

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write the targets."""
        posture = problem.posture
        _follow(posture.q, posture.rate, problem.q, self._gain, self._weight, target)


@compiled(NOTHING(VECTOR, VECTOR, VECTOR, NUMBER, VECTOR, VECTOR))
def _follow(q_ref: Array, rate_ref: Array, q: Array, gain: float, weight: Array, target: Array) -> None:
    """Write the targets (7) of the configurations (12)."""
    for i in range(7):
        target[i] = weight[i] * (rate_ref[5 + i] + gain * (q_ref[5 + i] - q[5 + i]))
