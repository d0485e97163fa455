"""The arm climbs to postures in which it is more dexterous."""

import math

from controller.whole_body.manipulability import Manipulability
from controller.whole_body.task import Demand
from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import ARM_XI


class ClimbManipulability:
    """n · q̇ = gain (ω_good − ω)/ω_good along the unit gradient n of ω, as long as ω is below ω_good."""

    name = "manipulability"
    rows = 1

    def __init__(self, weight: float, gain: float, good: float) -> None:
        """Bind the settings.

        Args:
            weight: Against the other tasks.
            gain: Velocity along the gradient where ω is 0 (rad/s).
            good: ω_good.
        """
        self._share, self._gain, self._good = math.sqrt(weight), gain, good
        #: Of the arm in this period; the method sets it before `write`.
        self.now: Manipulability | None = None

    def begin(self, jacobian: Array) -> None:
        """Nothing is the same in every posture."""

    def write(self, demand: Demand, jacobian: Array, target: Array) -> None:
        """Write the row."""
        now = self.now
        jacobian[0, ARM_XI] = 0.0
        target[0] = 0.0
        if now is None or now.value >= self._good:
            return
        gradient = now.gradient[ARM_XI]
        steepness = math.sqrt(float(gradient @ gradient))
        if steepness < 1e-6:
            return
        lack = 1.0 - now.value / self._good
        # The row fades in with the lack, so that nothing jumps where ω crosses ω_good.
        share = self._share * lack
        jacobian[0, ARM_XI] = gradient * (share / steepness)
        target[0] = share * self._gain * lack
