"""Sensor models of the camera: stereo depth with its errors, and colour with blur and noise."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.mesh import Floats
from bridge.sim.vineyard.row import Array

#: Relative depth step of an edge.
_STEP = 0.04
#: Fractions of the pixels with edge artifacts that get the foreground depth and a mixture; the rest gets none.
_NEARER, _MIXED = 0.45, 0.15
#: Objects narrower than this are thin wood (m): canes and spurs, not cordons.
_THIN = 0.02
#: Size of the patches without depth (px).
_PATCH = 6


def depth_sensor(
    config: CameraConfig,
    focal: float,
    depth: Floats,
    pixel_width: Floats,
    rng: np.random.Generator,
    thin_lost: float = 0.0,
) -> Floats:
    """Measured depth (m); 0 where it is invalid.

    The noise is that of stereo matching, sigma = s z²/(f B) (RealSense tuning guide), with s in pixels. A matching
    window across an edge gives the foreground, a mixture, or no depth; thin objects lose depth in patches.

    Args:
        config: Range, noise and unit.
        focal: Focal length of these images (px).
        depth: True depth along the optical axis (m), infinite for the sky.
        pixel_width: Width in the image of the object at each pixel (px), infinite for the ground and the sky.
        rng: Random generator.
        thin_lost: Fraction of thin objects without depth, in the same patches: sun on active stereo.
    """
    # Drawn first, so that it does not depend on the other errors.
    normal = rng.standard_normal(depth.shape, dtype=np.float32)
    if config.edge_bleed > 0.0:
        depth = _edge_artifacts(config, depth, rng)
    seen = (depth >= config.min_range) & (depth <= config.max_range)
    true = np.where(seen, depth, np.float32(0.0))
    scale = np.float32(config.disparity_noise / (focal * config.baseline))
    noisy = true + scale * true * true * normal
    unit = np.float32(config.depth_unit)
    counted = np.round(noisy / unit) * unit
    if config.thin_width > 0.0 or thin_lost > 0.0:
        lost = np.clip(1.0 - pixel_width / np.float32(max(config.thin_width, 1e-6)), 0.0, 1.0)
        if thin_lost > 0.0:
            thin = pixel_width < np.float32(_THIN * focal) / np.maximum(true, np.float32(config.min_range))
            lost = np.maximum(lost, np.where(thin, np.float32(thin_lost), np.float32(0.0)))
        seen &= _patches(depth.shape, rng) >= lost
    return np.where(seen, counted, np.float32(0.0)).astype(np.float32)


def miscalibration(angle: float, seed: int) -> Array:
    """Error of the hand-eye calibration as a rotation (3×3)."""
    return np.asarray(Rotation.from_rotvec(np.random.default_rng([seed, 12]).normal(0.0, angle, 3)).as_matrix())


def _edge_artifacts(config: CameraConfig, depth: Floats, rng: np.random.Generator) -> Floats:
    bounded = np.minimum(depth, np.float32(1e3))
    near, far = minimum_filter(bounded, 3), maximum_filter(bounded, 3)
    edge = np.flatnonzero(far - near > _STEP * near)
    edge = edge[rng.random(len(edge)) < config.edge_bleed]
    kind, fraction = rng.random(len(edge)), rng.random(len(edge), dtype=np.float32)
    here = bounded.ravel()[edge]
    nearer = near.ravel()[edge]
    mixed = nearer + fraction * (np.minimum(far.ravel()[edge], nearer + np.float32(1.0)) - nearer)
    out = depth.copy().ravel()
    out[edge] = np.where(kind < _NEARER, nearer, np.where(kind < _NEARER + _MIXED, mixed, np.float32(np.inf)))
    # The foreground keeps its depth in most cases.
    keeps = (here == nearer) & (kind >= _NEARER) & (fraction < 0.7)
    out[edge[keeps]] = here[keeps]
    return out.reshape(depth.shape)


def _patches(shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Uniform random numbers 0…1, constant over patches."""
    height, width = shape[0], shape[1]
    cells = rng.random((height // _PATCH + 1, width // _PATCH + 1), dtype=np.float32)
    field: Floats = np.repeat(np.repeat(cells, _PATCH, axis=0), _PATCH, axis=1)[:height, :width]
    return field


def color_sensor(config: CameraConfig, color: Floats, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Measured colours, H×W×3.

    Args:
        config: Blur and noise.
        color: True colours 0…255 (H×W×3); values beyond are clipped.
        rng: Random generator.
    """
    if config.color_blur > 0.0:
        color = gaussian_filter(color, (config.color_blur, config.color_blur, 0.0), truncate=3.0)
    if config.color_noise > 0.0:
        # The noise is the same in the three channels.
        grain = rng.standard_normal((*color.shape[:2], 1), dtype=np.float32)
        color = color + np.float32(config.color_noise) * grain
    return np.clip(color, 0.0, 255.0).astype(np.uint8)
