"""How one simulated world looks: bark, soil, sky, sun and exposure, drawn from its seed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

Floats = NDArray[np.float32]

_BASE: dict[WoodClass, tuple[float, float, float]] = {
    "background": (0.0, 0.0, 0.0),
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
#: From the camera's side of the row, half high.
_SUN = np.array([-0.45, -0.65, 0.61])


@dataclass(frozen=True)
class Appearance:
    """Colours are sRGB 0…255.

    Attributes:
        colors: One a class of `WOOD_CLASSES` (N×3).
        zenith: Sky overhead (3).
        horizon: Sky at the horizon (3).
        sun: Unit vector towards the sun (3, world).
        ambient: Light from everywhere.
        diffuse: Light from the sun.
        exposure: Factor of each channel (3): exposure and white balance.
    """

    colors: Floats
    zenith: Floats
    horizon: Floats
    sun: Floats
    ambient: float
    diffuse: float
    exposure: Floats


def draw_appearance(seed: int, spread: float) -> Appearance:
    """The look of the world with this seed.

    Args:
        seed: Not negative.
        spread: 0 gives the same look to all; 1 is a winter's variety, larger for training.
    """
    rng = np.random.default_rng([seed, 11])
    colors = np.array([_BASE[kind] for kind in WOOD_CLASSES])
    # All wood of one vineyard shares a tone; each class strays from it a little.
    colors[list(_WOOD)] *= np.exp(spread * rng.normal(0.0, [0.10, 0.06, 0.08])) * np.exp(spread * rng.normal(0.0, 0.08))
    colors *= np.exp(spread * rng.normal(0.0, 0.05, colors.shape))
    soil = rng.dirichlet([1.0, 1.0, 1.0])
    ground = soil @ np.stack([_GRASS, _SOIL, _STRAW])
    colors[WOOD_CLASSES.index("ground")] += min(spread, 1.0) * (ground - _GRASS)
    overcast = min(spread, 1.0) * float(rng.uniform(0.0, 1.0))
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
