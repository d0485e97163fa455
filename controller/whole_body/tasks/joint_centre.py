"""Task: joints near a limit return towards their middle."""

from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.task import IkProblem
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, Limits


class JointCentre:
    """q̇ = ±gain · depth in the zone before a limit; the row's weight grows from 0 at its edge to 1 at the limit."""

    name = "joint centre"
    rows = 7

    def __init__(self, weight: float, gain: float, zone: float, limits: Limits, speed: Array) -> None:
        """Precompute the zones' edges.

        Args:
            weight: At the limit, against the other tasks.
            gain: Velocity out of the zone by depth in it (1/s).
            zone: Its width (rad).
            limits: Of the robot.
            speed: Largest ν (9).
        """
        self._gain = gain
        self._low, self._high = limits.lower[ARM_Q] + zone, limits.upper[ARM_Q] - zone
        self._scale = weight**0.5 / speed[ARM_XI] / zone

    def prepare(self, jacobian: Array) -> None:
        """Nothing is the same in every posture."""

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write the rows."""
        _go_back(problem.q, self._low, self._high, self._scale, self._gain, jacobian, target)


@compiled(NOTHING(VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, MATRIX, VECTOR))
def _go_back(q: Array, low: Array, high: Array, scale: Array, gain: float, jacobian: Array, target: Array) -> None:
    """Write the rows (7×9) and targets (7) of a configuration (12) between the zones' edges (7)."""
    for i in range(7):
        depth = max(low[i] - q[5 + i], 0.0) - max(q[5 + i] - high[i], 0.0)
        weight = abs(depth) * scale[i]
        jacobian[i, 2 + i], target[i] = weight, weight * gain * depth
