"""Colours for what the rays hit: bark, posts, wires, soil and sky, by class, under one low winter sun."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bridge.sim.camera_mesh import Floats, Indices
from rolling_panda.messages import WOOD_CLASSES, WoodClass

Bytes = NDArray[np.uint8]

_PALETTE: dict[WoodClass, tuple[float, float, float]] = {
    "background": (0.0, 0.0, 0.0),
    "ground": (106.0, 103.0, 62.0),
    "post": (140.0, 118.0, 92.0),
    "trunk": (84.0, 66.0, 52.0),
    "cordon": (96.0, 74.0, 58.0),
    "spur": (118.0, 86.0, 62.0),
    "cane": (164.0, 104.0, 62.0),
    "node": (112.0, 66.0, 42.0),
    "wire": (158.0, 162.0, 166.0),
}
_COLORS = np.array([_PALETTE[kind] for kind in WOOD_CLASSES], np.float32)
_ZENITH, _HORIZON = np.array([112.0, 158.0, 214.0], np.float32), np.array([222.0, 226.0, 224.0], np.float32)
#: From the camera's side of the row, half high.
_SUN = np.array([-0.45, -0.65, 0.61], np.float32)
_AMBIENT, _DIFFUSE = 0.55, 0.60
_PATTERN = 256


class Palette:
    """Colours of one simulated world; the same seed always paints it alike."""

    def __init__(self, seed: int) -> None:
        """Draw the textures."""
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
        light = _AMBIENT + _DIFFUSE * np.maximum(normal @ _SUN, 0.0)
        bright = light * self._tint[rod % 4096] * (1.0 + 0.16 * grain)
        color: Floats = _COLORS[kind] * bright[:, None]
        return color

    def ground(self, x: Floats, y: Floats, distance: Floats) -> Floats:
        """Colours (N, 3) of points on the ground (m, world): grass and soil that fade into the haze."""
        fine = self._noise[(x * 60.0).astype(np.int64) % _PATTERN, (y * 60.0).astype(np.int64) % _PATTERN]
        broad = self._noise[(x * 5.0).astype(np.int64) % _PATTERN, (y * 5.0).astype(np.int64) % _PATTERN]
        bright = 1.0 + 0.35 * fine + 0.25 * broad
        color = _COLORS[1] * bright[:, None]
        color[:, 0] += 22.0 * broad
        haze = (1.0 - np.exp(-distance / 25.0))[:, None]
        hazy: Floats = color * (1.0 - haze) + _HORIZON * haze
        return hazy

    def sky(self, elevation: Floats) -> Floats:
        """Colours (N, 3) for the sine of the elevation (N)."""
        high = np.sqrt(np.clip(elevation, 0.0, 1.0))[:, None]
        return (_HORIZON * (1.0 - high) + _ZENITH * high).astype(np.float32)
