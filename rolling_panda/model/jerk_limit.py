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
    """The greatest rise in this period from which the limit is still kept.

    Where it may be repeated n times against our will before it can fall, n β + β + (β − step) + … stays in the room.

    Args:
        room: What is left up to the limit (n); where it is negative, the answer leads back, without repeats at once.
        step: By how much the rise may change from one period to the next (n), positive.
        repeats: How often at most (n above).
    """
    share = step * (repeats + 0.5)
    inside = np.maximum(share * share - 0.25 * step * step + 2.0 * step * room, 0.0)
    rise: Array = np.maximum(np.sqrt(inside) - share, np.minimum(room / (1.0 + repeats), step))
    return rise
