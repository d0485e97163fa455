"""Coming to a limit with bounded jerk, in discrete time.

Something that may still rise by `room`, and whose rise per period may only fall by `step` from one period to the next,
rises in all by β + (β − step) + (β − 2 step) + … That stays within the room where

    β ≤ √(2 step · room) − step/2,    or    β ≤ min(room, step), since then the next rise may already be nothing.

Whoever keeps to the greater of the two can keep to it in the next period as well: the room is then smaller by β, and
β − step is inside the bound of that room (or nothing, which always is). So the bound never asks for more than `step`.
"""

import numpy as np

from rolling_panda.model.differential_drive import Array


def largest_rise(room: Array, step: Array, repeats: float = 0.0) -> Array:
    """The largest increment β of this period that still keeps the limit.

    If the last increment may be repeated n times by lost packets, n β + β + (β − step) + … stays within the margin.

    Args:
        room: Margin to the limit (n). If it is negative, the result leads back; without repeats, in one period.
        step: Largest change of the increment from one period to the next (n), positive.
        repeats: Largest number of repeats (n above).
    """
    half = step * (repeats + 0.5)
    inside = np.maximum(half * half - 0.25 * step * step + 2.0 * step * room, 0.0)
    rise: Array = np.maximum(np.sqrt(inside) - half, np.minimum(room / (1.0 + repeats), step))
    return rise
