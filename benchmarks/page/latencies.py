"""Times from the page to the robot and back, from what browser and simulator noted. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Before a movement of the hand the robot has to have been at rest for so long (s), and to answer within so long.
QUIET_S, ANSWER_S = 0.15, 0.8
#: The least speed that counts as motion (rad/s), and how many times what was there while it rested.
_LEAST, _ABOVE = 0.01, 4.0
#: More than this at rest, to and fro or on and on (rad/s), is no rest: such a movement is left out and counted.
_UNREST, _DRIFT = 0.05, 0.15
#: How often the screen is looked at for the age of what it shows (s).
_LOOK_S = 0.01


@dataclass(frozen=True)
class Spread:
    """Of `n` times (s), the usual ranks."""

    n: int
    median: float
    p95: float
    p99: float
    most: float


def spread(values: Sequence[float] | Array) -> Spread | None:
    """Median and percentiles, the nearest rank above; None of nothing."""
    ordered = sorted(float(value) for value in values)
    if not ordered:
        return None

    def rank(share: float) -> float:
        return round(ordered[max(0, math.ceil(share * len(ordered)) - 1)], 5)

    return Spread(len(ordered), rank(0.5), rank(0.95), rank(0.99), round(ordered[-1], 5))


def onset(clock: Array, speeds: Array, at: float) -> float | None:
    """Seconds from `at` until the first speed leaves its rest; inf if none does in time, None without a rest before.

    Args:
        clock: Of each row (n, s).
        speeds: Of each actuator (n×m, rad/s).
        at: When the hand moved (s).
    """
    begin, here, end = np.searchsorted(clock, [at - QUIET_S, at, at + ANSWER_S])
    resting = speeds[begin:here]
    if len(resting) < 10:
        return None
    level = np.median(resting, axis=0)
    noise = float(np.abs(resting - level).max())
    if noise > _UNREST or float(np.abs(level).max()) > _DRIFT:
        return None
    above = np.abs(speeds[here:end] - level).max(axis=1) > max(_LEAST, _ABOVE * noise)
    first = int(np.argmax(above)) if above.any() else -1
    return math.inf if first < 0 else float(clock[here + first]) - at


def times_of_stamps(stamps: Array, time: Array, clock: Array) -> Array:
    """When (s, the bridge's clock) the robot's times `stamps` were, from a trace.

    A simulated robot's time is where its clock stood at its first step, and a millisecond more with each.

    Args:
        stamps: On the robot's time (s).
        time: Simulated time of each step of the trace (s).
        clock: The bridge's clock at each (s).
    """
    began = float((clock[:500] - time[:500]).min())
    rows = np.clip(np.searchsorted(time, stamps - began - 5e-4), 0, len(clock) - 1)
    return np.asarray(clock[rows])


def ages(shown: Sequence[tuple[float, float]]) -> Array:
    """How old what stands on the screen is (s), looked at every 10 ms.

    Args:
        shown: Of each state in order: when it was measured, and when it was painted (s).
    """
    measured, painted = np.array(shown).T
    looks = np.arange(painted[0], painted[-1], _LOOK_S)
    return np.asarray(looks - measured[np.searchsorted(painted, looks, side="right") - 1])
