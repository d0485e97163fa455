"""Guard: distances of the robot to itself, the ground and obstacles.

For each pair of parts nearer than d_i, with ḋ the rate of their distance d:

ḋ ≥ −min( v_i (d − d_s)/(d_i − d_s), −a_i dt + √((a_i dt)² + 2 a_i (d − d_s)) )

The first term is Faverjon and Tournassoud's velocity damper. The second limits the approach to the speed from which
the pair can still stop, after one more period, with the deceleration a_i. Below d_s the pair has to separate. The
blades and the cutter's body have their own d_s. Canes have their own v_i and a_i, because the tool slides in between
them and they bend.
"""

import math

import numpy as np

from controller.config import HierarchyConfig, is_cane
from controller.whole_body.collision import CollisionModel
from controller.whole_body.compiled import NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.task import NO_ROWS, IkProblem, Inequalities
from rolling_panda.errors import ControlError
from rolling_panda.model.differential_drive import Array


class CollisionGuard:
    """One row for each near pair; it names both sides."""

    name = "collision"

    def __init__(self, model: CollisionModel, config: HierarchyConfig, dt: float) -> None:
        """Guard the pairs that `model` monitors, for a control period of `dt` (s)."""
        self.model = model
        self._influence, self._kept = config.collision_influence, config.kept
        self._usual = config.collision_speed, config.collision_braking
        self._cane = config.cane_speed, config.cane_braking
        self._dt = dt

    def rows(self, problem: IkProblem) -> Inequalities:
        """Constraints of this period."""
        try:
            near = self.model.dampers(problem.q, self._influence, problem.kinematics)
        except ControlError:
            # The problem's kinematics are those of another robot model, or of an earlier moment.
            near = self.model.dampers(problem.q, self._influence)
        if not near.pairs:
            return NO_ROWS
        k = len(near.pairs)
        kept, speed, brake, lower = np.empty((4, k))
        for row, pair in enumerate(near.pairs):
            kept[row] = self._kept(pair)
            speed[row], brake[row] = self._cane if is_cane(pair) else self._usual
        _damp(near.distance, kept, self._influence, speed, brake, self._dt, lower)
        return Inequalities(near.normal_jacobian, lower, tuple([f"{a} – {b}" for a, b in near.pairs]))


@compiled(NOTHING(VECTOR, VECTOR, NUMBER, VECTOR, VECTOR, NUMBER, VECTOR))
def _damp(distance: Array, kept: Array, influence: float, speed: Array, brake: Array, dt: float, lower: Array) -> None:
    """Write the least ḋ (k) of pairs at `distance` d (k) of which `kept` d_s (k) is kept; see the head of this file.

    Args:
        distance: d (k, m).
        kept: d_s (k, m).
        influence: d_i (m).
        speed: v_i, and the fastest that a pair has to part (k, m/s).
        brake: a_i (k, m/s²).
        dt: Of the control period (s).
        lower: Written (k, m/s).
    """
    for i in range(len(distance)):
        room = distance[i] - kept[i]
        step = brake[i] * dt
        stopping = math.sqrt(step * step + 2.0 * brake[i] * max(room, 0.0)) - step
        approach = min(speed[i] * room / (influence - kept[i]), stopping)
        lower[i] = min(-approach, speed[i])
