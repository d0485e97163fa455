"""The quickest motion from rest to rest over a distance, within velocity, acceleration and jerk."""

import math
from dataclasses import dataclass

import numpy as np
from msgspec import Struct

from rolling_panda.model.differential_drive import Array

#: Shorter distances need no motion: they are covered at once, without velocity.
_NOTHING = 1e-12


@dataclass(frozen=True)
class Rates:
    """Limits of velocity, acceleration and jerk along one distance, in the unit of the distance and seconds."""

    velocity: float
    acceleration: float
    jerk: float


class Progress(Struct, frozen=True):
    """Progress 0…1 along a motion, and its first two time derivatives (1/s, 1/s²)."""

    s: float
    rate: float
    acceleration: float


@dataclass(frozen=True)
class Profile:
    """Distance covered over time.

    Seven phases of constant jerk: acceleration rises, stays, falls; velocity stays; then mirrored. For a short distance
    some phases have no length.

    Attributes:
        distance: Distance; negative backwards.
        jerk: Magnitude of the jerk in the phases of constant jerk.
        t_jerk: Duration of each of these phases (s).
        t_hold: Duration of each phase of constant acceleration (s).
        t_cruise: Duration of the phase of constant velocity (s).
    """

    distance: float
    jerk: float
    t_jerk: float
    t_hold: float
    t_cruise: float

    @property
    def ramp(self) -> float:
        """Time from rest to the greatest velocity (s)."""
        return 2.0 * self.t_jerk + self.t_hold

    @property
    def duration(self) -> float:
        """Time from rest to rest (s)."""
        return 2.0 * self.ramp + self.t_cruise

    def progress(self, time: float) -> Progress:
        """Share of the distance that is covered at `time` (s), and its derivatives; held before and after."""
        if time <= 0.0:
            return Progress(0.0, 0.0, 0.0)
        if time >= self.duration:
            return Progress(1.0, 0.0, 0.0)
        left = self.duration - time
        mirrored = min(time, left)
        ramp = min(mirrored, self.ramp)
        later, last = max(ramp - self.t_jerk, 0.0), max(ramp - self.t_jerk - self.t_hold, 0.0)
        jerk = self.jerk / abs(self.distance)
        rate = jerk / 2.0 * (ramp**2 - later**2 - last**2)
        s = jerk / 6.0 * (ramp**3 - later**3 - last**3) + rate * (mirrored - ramp)
        acceleration = jerk * (ramp - later - last) if mirrored < self.ramp else 0.0
        return Progress(s, rate, acceleration) if time <= left else Progress(1.0 - s, rate, -acceleration)

    def over(self, time: float, duration: float) -> Progress:
        """The same where it takes `duration` (s), more or less than its own."""
        faster = self.duration / duration
        at = self.progress(faster * time)
        return Progress(at.s, faster * at.rate, faster**2 * at.acceleration)

    def when(self, s: float) -> float:
        """Share of its duration after which the share `s` of the distance is covered."""
        low, high = 0.0, 1.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.progress(middle * self.duration).s < s else (low, middle)
        return 0.5 * (low + high)

    def at(self, time: Array) -> Array:
        """Distance covered at each time (s); held before the start and after the end."""
        if self.duration <= 0.0:
            return np.where(time < 0.0, 0.0, self.distance)
        t = np.clip(time, 0.0, self.duration)
        mirrored = np.minimum(t, self.duration - t)
        ramp = np.minimum(mirrored, self.ramp)
        covered = self._ramped(ramp) + self._speed() * (mirrored - ramp)
        covered = np.where(t <= self.duration / 2.0, covered, abs(self.distance) - covered)
        return math.copysign(1.0, self.distance) * covered

    def _speed(self) -> float:
        return self.jerk * self.t_jerk * (self.t_jerk + self.t_hold)

    def _ramped(self, t: Array) -> Array:
        """Distance covered in the ramp, which is the sum of three cubes."""
        later, last = np.maximum(t - self.t_jerk, 0.0), np.maximum(t - self.t_jerk - self.t_hold, 0.0)
        covered: Array = self.jerk / 6.0 * (t**3 - later**3 - last**3)
        return covered


def quickest(distance: float, rates: Rates) -> Profile:
    """The quickest profile over a distance within the rates."""
    d, v, a, j = abs(distance), rates.velocity, rates.acceleration, rates.jerk
    if d < _NOTHING:
        return Profile(distance, j, 0.0, 0.0, 0.0)
    # The greatest velocity reached: d = v (v/a + a/j) with a stretch of constant acceleration, 2 v √(v/j) without.
    speed = min(v, 2.0 * d * j / (math.sqrt(a * a + 4.0 * d * j * j / a) + a))
    if speed < a * a / j:
        speed = min(v, a * a / j, math.cbrt(d * d * j / 4.0))
    t_jerk = min(a / j, math.sqrt(speed / j))
    t_hold = max(speed / (j * t_jerk) - t_jerk, 0.0)
    t_cruise = max(d / speed - 2.0 * t_jerk - t_hold, 0.0)
    # Rounding of the times would leave an error at the end; the jerk compensates it.
    covered = t_jerk * (t_jerk + t_hold) * (2.0 * t_jerk + t_hold + t_cruise)
    return Profile(distance, d / covered, t_jerk, t_hold, t_cruise)


def together(*ways: tuple[float, Rates]) -> Rates:
    """Limits of a common progress 0…1 over several distances at once, each with its own rates."""
    sizes = [(max(abs(distance), _NOTHING), rates) for distance, rates in ways]
    return Rates(
        min(rates.velocity / size for size, rates in sizes),
        min(rates.acceleration / size for size, rates in sizes),
        min(rates.jerk / size for size, rates in sizes),
    )


def durations(distances: Array, rates: Rates) -> Array:
    """Time of the quickest profile (s) over each of many distances."""
    v, a, j = rates.velocity, rates.acceleration, rates.jerk
    d = np.maximum(np.abs(distances), _NOTHING)
    long = np.minimum(v, 2.0 * d * j / (np.sqrt(a * a + 4.0 * d * j * j / a) + a))
    short = np.minimum(min(v, a * a / j), np.cbrt(d * d * j / 4.0))
    time: Array = np.where(
        long < a * a / j,
        d / short + 2.0 * np.sqrt(short / j),
        d / long + long / a + a / j,
    )
    return np.where(np.abs(distances) < _NOTHING, 0.0, time)
