"""Speed scaling of a method without inequality constraints, so that it stops before a contact.

The velocity is scaled as a whole until every row of the guard holds. Its direction does not change: the robot stops
before an obstacle and moves on as soon as the commanded motion leads away from it.
"""

import numpy as np

from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Guard, IkProblem, Inequalities, Method, Solution
from rolling_panda.model.differential_drive import Array

#: Below this scale the reason is reported.
_TOLD = 0.5
#: Below this scale the problem counts as infeasible.
_HELD = 1e-2


class SpeedScaling:
    """A method whose speed a guard limits."""

    def __init__(self, method: Method, guard: Guard, saturation: Saturation) -> None:
        """Bind the parts, all of the same control period."""
        self.name, self.flows = method.name, method.flows
        self._method, self._guard, self._saturation = method, guard, saturation

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        out = self._method.solve(problem)
        if not problem.finite:
            return out
        speed_scale, what = allowed_speed_scale(self._guard.rows(problem), out.xi)
        if speed_scale >= 1.0:
            return out
        limited = self._saturation.apply(speed_scale * out.xi, problem.q, problem.sent)
        reason = what if speed_scale < _TOLD else out.reason
        return Solution(
            limited.xi, out.scale * speed_scale, out.manipulability, out.feasible and speed_scale >= _HELD, reason
        )


def allowed_speed_scale(rows: Inequalities, xi: Array) -> tuple[float, str]:
    """The largest speed scale, 0…1, for which every row holds, and the name of the most restrictive row.

    For a row that no scale satisfies (a pair that has to part), the distance must not become smaller.

    Args:
        rows: A ξ̇ ≥ lower.
        xi: ξ̇ (9).
    """
    speed_scale, what = 1.0, ""
    for rate, lower, name in zip((rows.A @ xi).tolist(), np.minimum(rows.lower, 0.0).tolist(), rows.names, strict=True):
        if rate < lower and lower / rate < speed_scale:
            speed_scale, what = lower / rate, name
    return speed_scale, what
