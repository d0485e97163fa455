"""How well a mean over several looks is known."""

import numpy as np

from perception.plant.model import Array

#: What one look may be off before others tell, one standard deviation: depth (2.9 mm at 0.9 m, 0.08 px of a D435i) and
#: half a pixel along the cane (m); the direction of some centimetres of axis (rad).
_LOOK, _DIRECTION = 0.003, 0.05
#: What all looks have in common and averaging does not take away: the camera looks 1 mrad elsewhere than the robot
#: thinks, and the wheels slip (m); the same of directions (rad).
_COMMON, _COMMON_DIRECTION = 0.0015, 0.01


def of_place(scatter: Array, looks: int) -> Array:
    """Covariance (3×3, m²) of a mean place.

    Args:
        scatter: Covariance of single looks as seen (3×3, m²).
        looks: How many went into the mean.
    """
    return _of_mean(scatter, looks, _LOOK**2 * np.eye(3)) + _COMMON**2 * np.eye(3)


def of_direction(scatter: Array, looks: int, direction: Array) -> Array:
    """Covariance (3×3) of a mean unit vector; along itself it is known.

    Args:
        scatter: Covariance of single looks as seen (3×3).
        looks: How many went into the mean.
        direction: The unit vector (3).
    """
    across = np.eye(3) - np.outer(direction, direction)
    out: Array = across @ _of_mean(scatter, looks, _DIRECTION**2 * np.eye(3)) @ across + _COMMON_DIRECTION**2 * across
    return out


def _of_mean(scatter: Array, looks: int, before: Array) -> Array:
    single = (before + looks * scatter) / (1.0 + looks)
    out: Array = single / looks
    return out
