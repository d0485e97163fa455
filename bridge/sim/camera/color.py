"""Colours for what the rays hit: bark, posts, wires, soil and sky, by class, as the world with this seed looks."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bridge.sim.camera.appearance import draw_appearance
from bridge.sim.camera.mesh import Floats, Indices
from rolling_panda.messages.types import WOOD_CLASSES

Bytes = NDArray[np.uint8]

_GROUND = WOOD_CLASSES.index("ground")
_PATTERN = 256


class Palette:
    """Colours of one simulated world; the same seed always paints it alike."""

    def __init__(self, seed: int, spread: float = 1.0) -> None:
        """Draw colours and textures.

        Args:
            seed: Not negative.
            spread: As of `draw_appearance`.
        """
        self._look = draw_appearance(seed, spread)
        rng = np.random.default_rng([seed, 1])
        self._tint = rng.uniform(0.86, 1.14, 4096).astype(np.float32)
        noise = np.zeros((_PATTERN, _PATTERN), np.float32)
        for cell in (1, 4, 16):
            white = rng.standard_normal((_PATTERN, _PATTERN), dtype=np.float32)
            smooth = gaussian_filter(white, cell / 2, mode="wrap")
            noise += smooth / smooth.std()
        self._noise = np.clip(noise / noise.std(), -2.0, 2.0).astype(np.float32) / 2.0

    def wood(self, rod: Indices, kind: Bytes, along: Floats, normal: Floats) -> Floats:
        """Colours (N, 3) of points on rods.

        Args:
            rod: Index of the rod (N).
            kind: Its class (N).
            along: Distance from the rod's start (N, m).
            normal: Outward unit normals (N, 3, world).
        """
        grain = self._noise[(along * 900.0).astype(np.int64) % _PATTERN, rod % _PATTERN]
        light = self._look.ambient + self._look.diffuse * np.maximum(normal @ self._look.sun, 0.0)
        bright = light * self._tint[rod % 4096] * (1.0 + 0.16 * grain)
        color: Floats = self._look.colors[kind] * bright[:, None] * self._look.exposure
        return color

    def ground(self, x: Floats, y: Floats, distance: Floats) -> Floats:
        """Colours (N, 3) of points on the ground (m, world): grass and soil that fade into the haze."""
        fine = self._noise[(x * 60.0).astype(np.int64) % _PATTERN, (y * 60.0).astype(np.int64) % _PATTERN]
        broad = self._noise[(x * 5.0).astype(np.int64) % _PATTERN, (y * 5.0).astype(np.int64) % _PATTERN]
        bright = 1.0 + 0.35 * fine + 0.25 * broad
        color = self._look.colors[_GROUND] * bright[:, None]
        color[:, 0] += 22.0 * broad
        haze = (1.0 - np.exp(-distance / 25.0))[:, None]
        hazy: Floats = (color * (1.0 - haze) + self._look.horizon * haze) * self._look.exposure
        return hazy

    def sky(self, elevation: Floats) -> Floats:
        """Colours (N, 3) for the sine of the elevation (N)."""
        high = np.sqrt(np.clip(elevation, 0.0, 1.0))[:, None]
        look = self._look
        return ((look.horizon * (1.0 - high) + look.zenith * high) * look.exposure).astype(np.float32)
