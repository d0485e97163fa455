"""Repulsion from joint limits: the paper's constraint task 2 (eqs. 17 and 18, corrected)."""

import numpy as np

from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, Limits


class LimitRepulsion:
    """Velocity that moves joints away from near limits, zero elsewhere and continuous at the zone's edge.

    The printed eq. 18 is zero at the limit, jumps at γ_start, and is always positive. Here it is
    k (γ_start − d)², positive near the lower limit and negative near the upper.
    """

    def __init__(self, limits: Limits, gain: float, zone: float) -> None:
        """Precompute the zone's edges.

        Args:
            limits: Of the robot.
            gain: k (1/(rad·s)).
            zone: γ_start (rad).
        """
        self._gain = gain
        self._low_edge = limits.lower[ARM_Q] + zone
        self._high_edge = limits.upper[ARM_Q] - zone

    def at(self, q: Array) -> Array:
        """Velocity over ξ (9) at a configuration (12); its wheel entries are zero."""
        arm = q[ARM_Q]
        below = np.maximum(self._low_edge - arm, 0.0)
        above = np.maximum(arm - self._high_edge, 0.0)
        out = np.zeros(NXI)
        out[ARM_XI] = self._gain * (below * below - above * above)
        return out


def margin(q: Array, limits: Limits) -> float:
    """Least distance (rad) of an arm joint to its limits; negative outside."""
    arm = q[ARM_Q]
    return float(np.minimum(arm - limits.lower[ARM_Q], limits.upper[ARM_Q] - arm).min())
