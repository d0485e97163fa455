"""Uneven ground: a slope across the row and smooth bumps."""

import math

import numpy as np

from bridge.sim.vineyard.row import Array
from bridge.sim.world.config import WorldConfig

#: Number of waves, and their lengths (m).
_WAVES, _LENGTHS = 16, (0.6, 3.0)


class Ground:
    """Height of the ground over the plane z = 0 of the row: a sum of waves, on a slope."""

    def __init__(self, config: WorldConfig, slope_across: float, seed: int) -> None:
        """Draw the bumps.

        Args:
            config: Their height: twice the standard deviation, which a bump rarely exceeds.
            slope_across: Of the ground across the row (rad).
            seed: Not negative.
        """
        rng = np.random.default_rng([seed, 0x6120])
        heading, length = rng.uniform(0.0, math.tau, _WAVES), rng.uniform(*_LENGTHS, _WAVES)
        self._wave = np.stack([np.cos(heading), np.sin(heading)], 1) * (math.tau / length)[:, None]
        self._phase = rng.uniform(0.0, math.tau, _WAVES)
        self._amplitude = config.bumps / 2 * math.sqrt(2.0 / _WAVES)
        self._across = math.tan(slope_across)

    def at(self, places: Array) -> tuple[Array, Array]:
        """Height (N, m) and upward unit normal (N×3) at places (N×2, m)."""
        angle = places @ self._wave.T + self._phase
        height = self._amplitude * np.sin(angle).sum(axis=1) + self._across * places[:, 1]
        slope = self._amplitude * np.cos(angle) @ self._wave
        normal = np.column_stack([-slope[:, 0], -slope[:, 1] - self._across, np.ones(len(places))])
        return height, normal / np.linalg.norm(normal, axis=1, keepdims=True)
