"""Task: small changes of velocity."""

import numpy as np

from controller.whole_body.actuation import Actuation
from controller.whole_body.compiled import NOTHING, PACKED, VECTOR, compiled
from controller.whole_body.task import IkProblem
from rolling_panda.model.differential_drive import NXI, Array


class Smoothness:
    """ν = ν sent last, for every actuator."""

    name = "smoothness"
    rows = NXI

    def __init__(self, weight: float, actuation: Actuation, speed: Array) -> None:
        """Scale by the largest speeds `speed` (9, ν)."""
        self._weight, self._actuation = weight**0.5 / speed, actuation

    def prepare(self, jacobian: Array) -> None:
        """Each actuator has a row of its own."""
        jacobian[:] = np.diag(self._weight)

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write the targets."""
        _keep(self._actuation.twist, problem.sent, self._weight, target)


@compiled(NOTHING(PACKED, VECTOR, VECTOR, VECTOR))
def _keep(twist: Array, sent: Array, weight: Array, target: Array) -> None:
    """Write the targets (9) after ξ̇ `sent` (9); `twist` gives [v, φ̇] of the wheels' speeds (2×2)."""
    for i in range(2):
        target[i] = weight[i] * (twist[i, 0] * sent[0] + twist[i, 1] * sent[1])
    for i in range(2, 9):
        target[i] = weight[i] * sent[i]
