"""A whole-body method at two rates: base and arm at the base rate, the arm alone at its higher rate.

In a period of the base the method solves two problems. The first is for all nine velocities over the base's period; the
base's velocities are sent. The second, as in every control period, is for the arm over the control period, with the
wheels' command fixed and the base moving as measured. So the arm's motion does not depend on which periods are the
base's, and the arm compensates the error of the base.

Methods are stateless. This class gives them the previous commands and the measured wheel speeds.
"""

import numpy as np
from msgspec.structs import replace

from controller.whole_body.compiled import MATRIX, NOTHING, VECTOR, compiled
from controller.whole_body.task import ActuatorTask, IkProblem, Method, Solution, ToolTask
from rolling_panda.model.differential_drive import NXI, Array


class TwoRates:
    """A method for one `IkProblem` in every control period. Call `start_period` in each period before `solve`."""

    def __init__(self, arm: Method, base: Method, every: int) -> None:
        """Bind the method for each period, and the same for a period of the base.

        Args:
            arm: The method for a control period.
            base: The same for a period of the base.
            every: How many control periods that has; with 1 `arm` is asked once for everything.
        """
        self.name, self.flows = arm.name, arm.flows
        self._arm, self._base, self._every = arm, base, every
        self._period = -1
        # What was sent at the end of the last two periods of the base.
        self._sent, self._sent_before = np.zeros(NXI), np.zeros(NXI)
        self._before = np.zeros(NXI)
        self._wheels: Array | None = None

    def start_period(self, sent: Array, before: Array, wheels: Array | None) -> None:
        """A new period.

        Args:
            sent: Last command ξ̇ (9).
            before: Command ξ̇ before the last (9).
            wheels: Measured or predicted velocities of the wheels (2, rad/s); None uses the last command.
        """
        self._period = (self._period + 1) % self._every
        if self._period == 0:
            self._sent, self._sent_before = sent, self._sent
        self._before, self._wheels = before, wheels

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        sent = problem.sent
        wheels = sent[:2] if self._wheels is None else self._wheels
        if self._every == 1 or problem.base == "frozen":
            return self._arm.solve(replace(problem, tool=_compensated(problem, wheels), before=self._before))
        if self._period == 0:
            base = self._base.solve(replace(problem, before=self._sent_before))
            sent = sent.copy()
            sent[:2] = base.xi[:2]
        before = self._before.copy()
        # In the arm's periods the base approaches its command with a constant acceleration.
        for wheel in (0, 1):
            before[wheel] = sent[wheel] - (sent[wheel] - self._sent[wheel]) / self._every
        return self._arm.solve(replace(problem, sent=sent, before=before, held=wheels))


def _compensated(problem: IkProblem, wheels: Array) -> ToolTask | ActuatorTask:
    """The tool's task plus the twist that the base lacks: the difference of commanded and measured wheel speeds."""
    tool = problem.tool
    if not isinstance(tool, ToolTask):
        return tool
    twist = np.empty(6)
    _owed(problem.kinematics.J_xi, problem.sent, wheels, tool.twist, twist)
    return ToolTask(twist, tool.free_axis, tool.keep_path, tool.ahead)


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, VECTOR, VECTOR))
def _owed(J_xi: Array, sent: Array, wheels: Array, twist: Array, more: Array) -> None:
    """More = twist + J_ξ (ξ̇_sent − ξ̇) over the wheels."""
    for i in range(6):
        more[i] = twist[i]
        for j in range(2):
            more[i] += J_xi[i, j] * (sent[j] - wheels[j])
