"""Guard: the tool stays ahead of the axle in transit.

With the tool at (x_tool, y_tool) in base_link the base gives it the velocity [v − y_tool φ̇, x_tool φ̇]. Steering
towards a tool that moves sideways is stable only if the tool is ahead of the axle (x_tool > 0, driving forward).
Behind the axle the base jack-knifes, like a trailer that is pushed backwards. So x_tool decreases towards `ahead` no
faster than ẋ_tool ≥ −rate (x_tool − ahead), and increases below it.
"""

import math

import numpy as np

from controller.whole_body.task import NO_ROWS, IkProblem, Inequalities
from rolling_panda.model.differential_drive import NXI
from rolling_panda.model.robot import ARM_Q, ARM_XI

#: Largest speed of the return to `ahead` (m/s).
_BACK = 0.1
_NAMES = ("the tool ahead of the axle",)


class AxleAhead:
    """One row in mode `transit`, none in the others."""

    name = "axle"

    def __init__(self, ahead: float, rate: float) -> None:
        """Keep the tool `ahead` (m) of the axle, approached at `rate` (1/s)."""
        self._ahead, self._rate = ahead, rate

    def rows(self, problem: IkProblem) -> Inequalities:
        """ẋ_tool depends on the arm alone: the base carries the tool along."""
        if problem.base != "transit":
            return NO_ROWS
        x, y, phi = problem.q[:3].tolist()
        c, s = math.cos(phi), math.sin(phi)
        tool = problem.kinematics.T_odom_tool.translation
        x_tool = c * (float(tool[0]) - x) + s * (float(tool[1]) - y)
        A = np.zeros((1, NXI))
        J = problem.kinematics.J
        A[0, ARM_XI] = c * J[0, ARM_Q] + s * J[1, ARM_Q]
        return Inequalities(A, np.array([min(-self._rate * (x_tool - self._ahead), _BACK)]), _NAMES)
