"""The robot keeps its distance from itself, the ground and obstacles.

For each pair of parts nearer than d_i, with n the direction between their nearest points and ḋ = nᵀ(v_b − v_a):

ḋ ≥ −min( ξ (d − d_s)/(d_i − d_s), −a dt + √((a dt)² + 2 a (d − d_s)) )

The first term is Faverjon and Tournassoud's velocity damper. The second lets a pair approach only as fast as it can
still stop, after one more period, with the deceleration a. Nearer than d_s, the pair has to part. The blades and the
cutter's body have a d_s of their own.
"""

import numpy as np

from controller.whole_body.collision import CollisionModel
from controller.whole_body.hierarchy_config import HierarchyConfig
from controller.whole_body.task import NO_ROWS, Demand, Inequalities
from rolling_panda.errors import ControlError


class CollisionGuard:
    """One row for each near pair; it names both sides."""

    name = "collision"

    def __init__(self, model: CollisionModel, config: HierarchyConfig, dt: float) -> None:
        """Guard what `model` watches, for a control period of `dt` (s)."""
        self.model = model
        self._influence, self._kept = config.collision_influence, config.kept
        self._speed = config.collision_speed
        self._part = config.collision_speed
        self._brake = config.collision_braking
        self._step = config.collision_braking * dt

    def rows(self, demand: Demand) -> Inequalities:
        """What has to hold in this period."""
        try:
            near = self.model.dampers(demand.q, self._influence, demand.kinematics)
        except ControlError:
            # The demand's kinematics are those of another robot model, or of an earlier moment.
            near = self.model.dampers(demand.q, self._influence)
        if not near.pairs:
            return NO_ROWS
        kept = np.array([self._kept(pair) for pair in near.pairs])
        room = near.distance - kept
        stopping = np.sqrt(self._step**2 + 2.0 * self._brake * np.maximum(room, 0.0)) - self._step
        approach = np.minimum(self._speed * room / (self._influence - kept), stopping)
        names = tuple(f"the distance of {a} to {b}" for a, b in near.pairs)
        return Inequalities(near.normal_jacobian, np.minimum(-approach, self._part), names)
