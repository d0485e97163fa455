"""The wheels and the caster stay on the ground: bounds on what base and arm may accelerate together."""

from controller.whole_body.hierarchy_rows import without_base
from controller.whole_body.task import Demand, Inequalities
from controller.whole_body.tipping import Tipping

_NAMES = ("the load on the caster", "the load on the right wheel", "the load on the left wheel")


class TippingGuard:
    """Three rows over the next ξ̇, one for each edge of the support triangle."""

    name = "tipping"

    def __init__(self, tipping: Tipping, dt: float) -> None:
        """Guard for a control period of `dt` (s)."""
        self._tipping, self._dt = tipping, dt

    def rows(self, demand: Demand) -> Inequalities:
        """What has to hold in this period."""
        # At the speeds of now: within one period they change by less than the margin is for.
        rows = self._tipping.rows(demand.q, demand.sent, S=demand.kinematics.S)
        matrix, lower = rows.over_velocity(demand.sent, self._dt)
        if demand.held is not None:
            # The base goes on accelerating as it was told to; the rows are about the arm alone.
            lower = without_base(matrix, 2.0 * demand.sent[:2] - demand.sent_before[:2] - demand.held, lower)
        return Inequalities(matrix, lower, _NAMES)
