"""Velocities change no more than they have to."""

import numpy as np

from controller.whole_body.actuation import Actuation
from controller.whole_body.task import Demand
from rolling_panda.differential_drive import NXI, Array


class Smoothness:
    """ν = ν sent last, for every actuator."""

    name = "smoothness"
    rows = NXI

    def __init__(self, weight: float, actuation: Actuation, speed: Array) -> None:
        """Scale by the largest speeds `speed` (9, ν)."""
        self._share, self._actuation = weight**0.5 / speed, actuation

    def begin(self, jacobian: Array) -> None:
        """Each actuator has a row of its own."""
        jacobian[:] = np.diag(self._share)

    def write(self, demand: Demand, jacobian: Array, target: Array) -> None:
        """Write the targets."""
        target[:] = self._share * self._actuation.nu(demand.sent)
