"""A small change of a motion's goal while it is under way: added to the motion, from rest to rest, it is no jump."""

from dataclasses import dataclass

import numpy as np

from controller.trajectory import Progress, Rates, quintic
from rolling_panda.differential_drive import Array


@dataclass(frozen=True)
class Correction:
    """A straight shift of everything that is still to come.

    A quintic begins and ends without velocity and acceleration, so that the sum of it and the motion goes on from the
    position, velocity and acceleration that the motion has, and ends at rest at the new goal.

    Attributes:
        begin: When it begins, on the motion's clock (s).
        duration: How long it takes (s).
        by: By how much (3, m, odom).
    """

    begin: float
    duration: float
    by: Array

    @classmethod
    def within(cls, begin: float, by: Array, rates: Rates) -> "Correction":
        """The shortest one within bounds of the tool's velocity, acceleration and jerk."""
        return cls(begin, max(rates.duration(float(np.linalg.norm(by))), 1e-3), by)

    @property
    def end(self) -> float:
        """When it has been made, on the motion's clock (s)."""
        return self.begin + self.duration

    def progress(self, time: float) -> Progress:
        """How much of it has been made at `time` (s)."""
        return quintic(time - self.begin, self.duration)
