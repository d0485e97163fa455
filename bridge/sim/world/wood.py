"""What becomes of a bite: blades that jam or leave a cane on its bark, and severed canes that hang or lie."""

import math

import numpy as np

from bridge.sim.vineyard.row import Array
from bridge.sim.world.config import WorldConfig

#: The failures of the configuration are those at this diameter (m), and their largest share at any.
_USUAL, _MOST = 0.008, 0.9
#: A cane that hangs has slid down and aside by this much (m).
_DOWN, _ASIDE = (0.01, 0.04), (0.015, 0.04)


class Wood:
    """Draws the fate of each bite."""

    def __init__(self, config: WorldConfig, seed: int) -> None:
        """Bind the shares of failures and of hanging canes; `seed` is not negative."""
        self._failures, self._hanging = config.blade_failures, config.hanging
        self._rng = np.random.default_rng([seed, 0x3D00])
        # A stream of its own, so that the fate of bites does not depend on it.
        self._fallen = np.random.default_rng([seed, 0xFA11])

    def fails(self, diameter: float) -> bool:
        """Whether the blades fail at wood of a diameter (m): the force that it needs grows with its cross-section."""
        share = min(self._failures * (diameter / _USUAL) ** 2, _MOST)
        return float(self._rng.uniform()) < share

    def jams(self) -> bool:
        """Whether blades that fail jam; otherwise they close and leave the wood on its bark."""
        return float(self._rng.uniform()) < 0.5

    def hangs(self) -> Array | None:
        """How far a severed cane is moved (3, m) where it hangs in the wires; None where it falls."""
        drawn, azimuth = float(self._rng.uniform()), float(self._rng.uniform(0.0, math.tau))
        aside, down = float(self._rng.uniform(*_ASIDE)), float(self._rng.uniform(*_DOWN))
        if drawn >= self._hanging:
            return None
        return np.array([aside * math.cos(azimuth), aside * math.sin(azimuth), -down])

    def lies(self) -> float:
        """Azimuth of a severed cane on the ground (rad, world)."""
        return float(self._fallen.uniform(0.0, math.tau))
