"""Guard: wheels and caster stay on the ground."""

from controller.whole_body.hierarchy import without_base
from controller.whole_body.task import IkProblem, Inequalities
from controller.whole_body.tipping import Tipping

_NAMES = ("the load on the caster", "the load on the right wheel", "the load on the left wheel")


class TippingGuard:
    """Three rows over the next ξ̇, one for each edge of the support triangle."""

    name = "tipping"

    def __init__(self, tipping: Tipping, dt: float) -> None:
        """Guard for a control period of `dt` (s)."""
        self._tipping, self._dt = tipping, dt

    def rows(self, problem: IkProblem) -> Inequalities:
        """Constraints of this period."""
        # At the current speeds: their change within one period is covered by the margin.
        rows = self._tipping.rows(problem.q, problem.sent, S=problem.kinematics.S)
        matrix, lower = rows.over_velocity(problem.sent, self._dt)
        if problem.held is not None:
            # The base keeps its commanded acceleration; the rows are for the arm alone.
            lower = without_base(matrix, 2.0 * problem.sent[:2] - problem.sent_before[:2] - problem.held, lower)
        return Inequalities(matrix, lower, _NAMES)
