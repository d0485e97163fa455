"""Joints near a limit go back towards their middle."""

import numpy as np

from controller.whole_body.task import Demand
from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import ARM_Q, ARM_XI, Limits


class JointCentre:
    """q̇ = ±gain · depth in the zone before a limit; the row's weight grows from 0 at its edge to 1 at the limit."""

    name = "joint centre"
    rows = 7

    def __init__(self, weight: float, gain: float, zone: float, limits: Limits, speed: Array) -> None:
        """Precompute the zones' edges.

        Args:
            weight: At the limit, against the other tasks.
            gain: Velocity out of the zone by depth in it (1/s).
            zone: Its width (rad).
            limits: Of the robot.
            speed: Largest ν (9).
        """
        self._gain = gain
        self._low, self._high = limits.lower[ARM_Q] + zone, limits.upper[ARM_Q] - zone
        self._scale = weight**0.5 / speed[ARM_XI] / zone
        self._diagonal = np.zeros(7)

    def begin(self, jacobian: Array) -> None:
        """Keep a view of the diagonal, where each joint's entry is."""
        self._diagonal = np.einsum("ii->i", jacobian[:, ARM_XI])

    def write(self, demand: Demand, jacobian: Array, target: Array) -> None:
        """Write the rows."""
        arm = demand.q[ARM_Q]
        depth = np.maximum(self._low - arm, 0.0) - np.maximum(arm - self._high, 0.0)
        share = np.abs(depth) * self._scale
        self._diagonal[:] = share
        target[:] = share * (self._gain * depth)
