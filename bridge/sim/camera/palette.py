"""Colours of one simulated world: bark, soil, sky, sun and exposure, drawn from its seed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bridge.sim.camera.mesh import Floats, Indices
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

_BASE: dict[WoodClass, tuple[float, float, float]] = {
    # Of the row itself: tendrils and old leaves.
    "background": (128.0, 92.0, 56.0),
    "ground": (106.0, 103.0, 62.0),
    "post": (140.0, 118.0, 92.0),
    "trunk": (84.0, 66.0, 52.0),
    "cordon": (96.0, 74.0, 58.0),
    "spur": (118.0, 86.0, 62.0),
    "cane": (164.0, 104.0, 62.0),
    "node": (112.0, 66.0, 42.0),
    "wire": (158.0, 162.0, 166.0),
    "hose": (34.0, 34.0, 37.0),
    "old cut": (92.0, 82.0, 74.0),
}
_WOOD = tuple(WOOD_CLASSES.index(kind) for kind in ("trunk", "cordon", "spur", "cane", "node", "old cut"))
_GRASS, _SOIL, _STRAW = (np.array(color) for color in ((106.0, 103.0, 62.0), (112.0, 88.0, 66.0), (152.0, 138.0, 96.0)))
_ZENITH, _HORIZON, _CLOUD = (
    np.array(color) for color in ((112.0, 158.0, 214.0), (222.0, 226.0, 224.0), (204.0, 207.0, 210.0))
)
#: Direction of the sun, from the camera's side of the row.
_SUN = np.array([-0.45, -0.65, 0.61])


@dataclass(frozen=True)
class Appearance:
    """Colours (sRGB 0…255) and light of a scene.

    Attributes:
        colors: Of each class in `WOOD_CLASSES` (N×3).
        zenith: Sky at the zenith (3).
        horizon: Sky at the horizon (3).
        sun: Unit vector towards the sun (3, world).
        ambient: Ambient light.
        diffuse: Direct light of the sun.
        exposure: Gain of each channel (3): exposure and white balance.
    """

    colors: Floats
    zenith: Floats
    horizon: Floats
    sun: Floats
    ambient: float
    diffuse: float
    exposure: Floats


def draw_appearance(seed: int, spread: float, clear: bool = False) -> Appearance:
    """Random appearance of a scene.

    Args:
        seed: Not negative.
        spread: 0 gives the same appearance to all seeds; 1 is the variety of one winter, larger for training.
        clear: Without clouds.
    """
    rng = np.random.default_rng([seed, 11])
    colors = np.array([_BASE[kind] for kind in WOOD_CLASSES])
    # All wood of a vineyard shares a tone, with a small variation of each class.
    colors[list(_WOOD)] *= np.exp(spread * rng.normal(0.0, [0.10, 0.06, 0.08])) * np.exp(spread * rng.normal(0.0, 0.08))
    colors *= np.exp(spread * rng.normal(0.0, 0.05, colors.shape))
    soil = rng.dirichlet([1.0, 1.0, 1.0])
    ground = soil @ np.stack([_GRASS, _SOIL, _STRAW])
    colors[WOOD_CLASSES.index("ground")] += min(spread, 1.0) * (ground - _GRASS)
    overcast = min(spread, 1.0) * float(rng.uniform(0.0, 1.0)) * (not clear)
    sun = _SUN + spread * rng.normal(0.0, 0.35, 3)
    sun[2] = max(sun[2], 0.15)
    exposure = np.exp(spread * (rng.normal(0.0, 0.18) + rng.normal(0.0, 0.03, 3)))
    return Appearance(
        colors=colors.astype(np.float32),
        zenith=((1 - overcast) * _ZENITH + overcast * _CLOUD).astype(np.float32),
        horizon=((1 - overcast) * _HORIZON + overcast * _CLOUD).astype(np.float32),
        sun=(sun / np.linalg.norm(sun)).astype(np.float32),
        ambient=0.55 + 0.3 * overcast,
        diffuse=0.60 * (1.0 - 0.85 * overcast),
        exposure=exposure.astype(np.float32),
    )


Bytes = NDArray[np.uint8]

_GROUND = WOOD_CLASSES.index("ground")
_TEXTURE_SIZE = 256


class Palette:
    """Colours and textures of one scene."""

    def __init__(self, seed: int, spread: float = 1.0, clear: bool = False) -> None:
        """Draw colours and textures; arguments as of `draw_appearance`."""
        self.look = draw_appearance(seed, spread, clear)
        rng = np.random.default_rng([seed, 1])
        self._tint = rng.uniform(0.86, 1.14, 4096).astype(np.float32)
        noise = np.zeros((_TEXTURE_SIZE, _TEXTURE_SIZE), np.float32)
        for cell in (1, 4, 16):
            white = rng.standard_normal((_TEXTURE_SIZE, _TEXTURE_SIZE), dtype=np.float32)
            smooth = gaussian_filter(white, cell / 2, mode="wrap")
            noise += smooth / smooth.std()
        self._noise = np.clip(noise / noise.std(), -2.0, 2.0).astype(np.float32) / 2.0

    def wood(self, rod: Indices, kind: Bytes, along: Floats, normal: Floats, lit: Floats | None = None) -> Floats:
        """Colours (N, 3) of points on rods.

        Args:
            rod: Index of the rod (N).
            kind: Its class (N).
            along: Distance from the rod's start (N, m).
            normal: Outward unit normals (N, 3, world).
            lit: Factors by their light (N, 3); None for the scene's own.
        """
        grain = self._noise[(along * 900.0).astype(np.int64) % _TEXTURE_SIZE, rod % _TEXTURE_SIZE]
        if lit is None:
            light = self.look.ambient + self.look.diffuse * np.maximum(normal @ self.look.sun, 0.0)
            bright = (light * self._tint[rod % 4096] * (1.0 + 0.16 * grain))[:, None]
        else:
            bright = lit * (self._tint[rod % 4096] * (1.0 + 0.16 * grain))[:, None]
        color: Floats = self.look.colors[kind] * bright * self.look.exposure
        return color

    def wet(self, share: float, rod: Indices, along: Floats) -> NDArray[np.bool_]:
        """Whether points on rods (N) are in patches that cover this share of them."""
        patch = self._noise[(along * 150.0 + 37.0 * rod).astype(np.int64) % _TEXTURE_SIZE, rod % _TEXTURE_SIZE]
        covered: NDArray[np.bool_] = patch <= np.quantile(self._noise, share)
        return covered

    def ground(self, x: Floats, y: Floats, distance: Floats, lit: Floats | None = None) -> Floats:
        """Colours (N, 3) of points on the ground (m, world): grass and soil with haze; `lit` as of `wood`."""
        fine = self._noise[(x * 60.0).astype(np.int64) % _TEXTURE_SIZE, (y * 60.0).astype(np.int64) % _TEXTURE_SIZE]
        broad = self._noise[(x * 5.0).astype(np.int64) % _TEXTURE_SIZE, (y * 5.0).astype(np.int64) % _TEXTURE_SIZE]
        bright = 1.0 + 0.35 * fine + 0.25 * broad
        color = self.look.colors[_GROUND] * bright[:, None]
        color[:, 0] += 22.0 * broad
        if lit is not None:
            color *= lit
        haze = (1.0 - np.exp(-distance / 25.0))[:, None]
        hazy: Floats = (color * (1.0 - haze) + self.look.horizon * haze) * self.look.exposure
        return hazy

    def sky(self, elevation: Floats) -> Floats:
        """Colours (N, 3) for the sine of the elevation (N)."""
        high = np.sqrt(np.clip(elevation, 0.0, 1.0))[:, None]
        look = self.look
        return ((look.horizon * (1.0 - high) + look.zenith * high) * look.exposure).astype(np.float32)
