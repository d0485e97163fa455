"""What a colour sensor makes of the light: blur, noise and 8 bits."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.mesh import Floats


def photographed(config: CameraConfig, color: Floats, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The image (H×W×3) of true colours 0…255 that may reach beyond.

    Args:
        config: Blur and noise.
        color: H×W×3.
        rng: Source of the noise.
    """
    if config.color_blur > 0.0:
        color = gaussian_filter(color, (config.color_blur, config.color_blur, 0.0), truncate=3.0)
    if config.color_noise > 0.0:
        # Grain is alike in the three channels but for a little.
        grain = rng.standard_normal((*color.shape[:2], 1), dtype=np.float32)
        color = color + np.float32(config.color_noise) * grain
    return np.clip(color, 0.0, 255.0).astype(np.uint8)
