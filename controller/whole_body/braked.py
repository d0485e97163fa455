"""Brakes before contact a method that knows no inequalities.

The method's answer is slowed as a whole until every row of the guard holds, which for a distance means: as slow as can
still be stopped. It is not bent, so that the robot stands still before what the method would lead it into, and goes on
as soon as that leads away.
"""

import numpy as np

from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Demand, Guard, Inequalities, Method, Solution
from rolling_panda.differential_drive import Array

#: Slowed to less than this the robot is held back, and says by what.
_TOLD = 0.5
#: Slower than this the motion's clock stands still.
_HELD = 1e-2


class Braked:
    """A method and the guard that brakes it."""

    def __init__(self, method: Method, guard: Guard, saturation: Saturation) -> None:
        """Bind the parts, all of the same control period."""
        self.name, self.flows = method.name, method.flows
        self._method, self._guard, self._saturation = method, guard, saturation

    def solve(self, demand: Demand) -> Solution:
        """The actuator velocities that answer the demand; see `Method.solve`."""
        out = self._method.solve(demand)
        if not demand.finite:
            return out
        share, what = allowed_share(self._guard.rows(demand), out.xi)
        if share >= 1.0:
            return out
        limited = self._saturation.apply(share * out.xi, demand.q, demand.sent)
        reason = f"{what} holds the robot back" if share < _TOLD else out.reason
        return Solution(limited.xi, out.scale * share, out.manipulability, out.feasible and share >= _HELD, reason)


def allowed_share(rows: Inequalities, xi: Array) -> tuple[float, str]:
    """The largest share of a velocity, 0…1, that satisfies every row, and the name of the one that asks for the least.

    Of a row that no share satisfies, since what is too near would have to part, it is asked that it gets no worse.

    Args:
        rows: A ξ̇ ≥ lower.
        xi: ξ̇ (9).
    """
    share, what = 1.0, ""
    for rate, lower, name in zip((rows.A @ xi).tolist(), np.minimum(rows.lower, 0.0).tolist(), rows.names, strict=True):
        if rate < lower and lower / rate < share:
            share, what = lower / rate, name
    return share, what
