"""What a stereo depth camera makes of true depth: limits of range, noise that grows with its square, quantisation."""

import numpy as np

from bridge.sim.camera_config import CameraConfig
from bridge.sim.camera_mesh import Floats


def measured_depth(config: CameraConfig, focal: float, depth: Floats, rng: np.random.Generator) -> Floats:
    """Depth as the camera reports it (m); 0 where it has none.

    The error is that of matching, sigma = s z²/(f B) (RealSense tuning guide), with s in pixels.

    Args:
        config: Range, noise and unit.
        focal: Focal length of these images (px).
        depth: True depth along the optical axis (m), infinite where nothing is.
        rng: Source of the noise.
    """
    seen = (depth >= config.min_range) & (depth <= config.max_range)
    true = np.where(seen, depth, np.float32(0.0))
    scale = np.float32(config.disparity_noise / (focal * config.baseline))
    noisy = true + scale * true * true * rng.standard_normal(depth.shape, dtype=np.float32)
    unit = np.float32(config.depth_unit)
    counted = np.round(noisy / unit) * unit
    return np.where(seen, counted, np.float32(0.0)).astype(np.float32)
