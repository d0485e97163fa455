"""Slip of the wheels on soft soil, and what their encoders tell of it."""

import numpy as np

from bridge.sim.vineyard.row import Array

#: Path over which the slip of a wheel stays about the same (m).
_CORRELATED = 0.5


class Slip:
    """Slip of the two driven wheels: an encoder turns by `factor` times what the ground is rolled off.

    It changes with the path alone (Ornstein-Uhlenbeck), so that a base at rest keeps its place.
    """

    def __init__(self, deviation: float, radius: float, seed: int) -> None:
        """Start at a random slip.

        Args:
            deviation: Standard deviation of the slip.
            radius: Of the wheels (m).
            seed: Not negative.
        """
        self._deviation, self._radius = deviation, radius
        self._rng = np.random.default_rng([seed, 0x511B])
        self._slip = deviation * self._rng.standard_normal(2)
        #: Angles that the encoders show (2, rad).
        self.encoders: Array = np.zeros(2)

    @property
    def factor(self) -> Array:
        """Turned angle over rolled angle of each wheel (2)."""
        out: Array = 1.0 + np.clip(self._slip, -0.5, 0.5)
        return out

    def roll(self, angles: Array) -> None:
        """Advance by these rolled angles (2, rad)."""
        self.encoders = self.encoders + self.factor * angles
        path = np.abs(angles) * self._radius / _CORRELATED
        noise = self._deviation * np.sqrt(2.0 * path) * self._rng.standard_normal(2)
        self._slip = self._slip * np.exp(-path) + noise
