"""What a stereo depth camera makes of true depth: range, noise, bleeding edges, thin things lost, quantisation."""

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.mesh import Floats
from bridge.sim.vineyard.row import Array

#: Neighbours whose depths differ by more than this share are on either side of an edge.
_STEP = 0.04
#: Of the disturbed pixels along an edge, shares that get the nearer depth, a mixture, and none.
_NEARER, _MIXED = 0.45, 0.15
#: Lost depth comes in patches of this size (px).
_PATCH = 6


def measured_depth(
    config: CameraConfig, focal: float, depth: Floats, seen_width: Floats, rng: np.random.Generator
) -> Floats:
    """Depth as the camera reports it (m); 0 where it has none.

    The error is that of matching, sigma = s z²/(f B) (RealSense tuning guide), with s in pixels. A matching window that
    straddles an edge gives what is in front, a mixture, or nothing; one that holds too little of a thin thing loses it.

    Args:
        config: Range, noise and unit.
        focal: Focal length of these images (px).
        depth: True depth along the optical axis (m), infinite where nothing is.
        seen_width: Width in the image of what each pixel shows (px), infinite for what is broad.
        rng: Source of the noise.
    """
    # In this order, so that the plain noise is the same whatever else is switched on.
    normal = rng.standard_normal(depth.shape, dtype=np.float32)
    if config.edge_bleed > 0.0:
        depth = _bled(config, depth, rng)
    seen = (depth >= config.min_range) & (depth <= config.max_range)
    true = np.where(seen, depth, np.float32(0.0))
    scale = np.float32(config.disparity_noise / (focal * config.baseline))
    noisy = true + scale * true * true * normal
    unit = np.float32(config.depth_unit)
    counted = np.round(noisy / unit) * unit
    if config.thin_width > 0.0:
        lost = np.clip(1.0 - seen_width / np.float32(config.thin_width), 0.0, 1.0)
        seen &= _patches(depth.shape, rng) >= lost
    return np.where(seen, counted, np.float32(0.0)).astype(np.float32)


def miscalibration(angle: float, seed: int) -> Array:
    """A rotation (3×3) by which the camera looks elsewhere than the robot thinks; one for each seed."""
    return np.asarray(Rotation.from_rotvec(np.random.default_rng([seed, 12]).normal(0.0, angle, 3)).as_matrix())


def _bled(config: CameraConfig, depth: Floats, rng: np.random.Generator) -> Floats:
    bounded = np.minimum(depth, np.float32(1e3))
    near, far = minimum_filter(bounded, 3), maximum_filter(bounded, 3)
    edge = np.flatnonzero(far - near > _STEP * near)
    edge = edge[rng.random(len(edge)) < config.edge_bleed]
    kind, share = rng.random(len(edge)), rng.random(len(edge), dtype=np.float32)
    here = bounded.ravel()[edge]
    nearer = near.ravel()[edge]
    mixed = nearer + share * (np.minimum(far.ravel()[edge], nearer + np.float32(1.0)) - nearer)
    out = depth.copy().ravel()
    out[edge] = np.where(kind < _NEARER, nearer, np.where(kind < _NEARER + _MIXED, mixed, np.float32(np.inf)))
    # A thing that is in front anyway keeps its depth more often than it loses it.
    keeps = (here == nearer) & (kind >= _NEARER) & (share < 0.7)
    out[edge[keeps]] = here[keeps]
    return out.reshape(depth.shape)


def _patches(shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Uniform numbers 0…1 that are the same over patches."""
    height, width = shape[0], shape[1]
    cells = rng.random((height // _PATCH + 1, width // _PATCH + 1), dtype=np.float32)
    field: Floats = np.repeat(np.repeat(cells, _PATCH, axis=0), _PATCH, axis=1)[:height, :width]
    return field
