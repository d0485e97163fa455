"""Task: the arm increases its manipulability."""

import math

import numpy as np

from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.manipulability import Manipulability
from controller.whole_body.task import IkProblem
from rolling_panda.model.differential_drive import NXI, Array

#: Length below which a gradient has no direction.
_FLAT = 1e-6
_LEVEL = np.zeros(NXI)


class ClimbManipulability:
    """n · q̇ = gain (ω_good − ω)/ω_good along the unit gradient n of ω, as long as ω is below ω_good."""

    name = "manipulability"
    rows = 1

    def __init__(self, weight: float, gain: float, good: float) -> None:
        """Bind the settings.

        Args:
            weight: Against the other tasks.
            gain: Velocity along the gradient where ω is 0 (rad/s).
            good: ω_good.
        """
        self._weight, self._gain, self._good = math.sqrt(weight), gain, good
        #: Of the arm in this period; the method sets it before `write`.
        self.now: Manipulability | None = None

    def prepare(self, jacobian: Array) -> None:
        """Nothing is the same in every posture."""

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write the row."""
        now = self.now
        lack = 0.0 if now is None else max(1.0 - now.value / self._good, 0.0)
        gradient = _LEVEL if now is None else now.gradient
        # The row's weight grows continuously from 0 at ω_good.
        _climb(gradient, self._weight * lack, self._gain * lack, jacobian, target)


@compiled(NOTHING(VECTOR, NUMBER, NUMBER, MATRIX, VECTOR))
def _climb(gradient: Array, weight: float, speed: float, jacobian: Array, target: Array) -> None:
    """Write the row (1×9) along the gradient (9) and its target; zero for a zero gradient."""
    steepness = 0.0
    for slope in gradient:
        steepness += slope * slope
    steepness = math.sqrt(steepness)
    if steepness < _FLAT:
        weight, steepness = 0.0, 1.0
    for i in range(9):
        jacobian[0, i] = weight * gradient[i] / steepness
    target[0] = weight * speed
