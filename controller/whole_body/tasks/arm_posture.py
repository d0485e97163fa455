"""The arm's joints go to the posture's."""

import numpy as np

from controller.whole_body.task import Demand
from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import ARM_Q, ARM_XI


class ArmPosture:
    """q̇ = q̇_ref + gain (q_ref − q) for each joint of the arm."""

    name = "arm posture"
    rows = 7

    def __init__(self, weight: float, gain: float, speed: Array) -> None:
        """Scale by the joints' largest speeds.

        Args:
            weight: Against the other tasks.
            gain: Of the posture's error (1/s).
            speed: Largest ν (9).
        """
        self._gain, self._share = gain, weight**0.5 / speed[ARM_XI]

    def begin(self, jacobian: Array) -> None:
        """Each joint has a row of its own."""
        jacobian[:, ARM_XI] = np.diag(self._share)

    def write(self, demand: Demand, jacobian: Array, target: Array) -> None:
        """Write the targets."""
        posture = demand.posture
        target[:] = self._share * (posture.rate[ARM_Q] + self._gain * (posture.q[ARM_Q] - demand.q[ARM_Q]))
