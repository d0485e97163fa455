"""What the fakes move: mechanics of the arm, of the wheels and of the blades, exact ones here."""

import math
import threading
import time
from typing import Protocol

import numpy as np

from rolling_panda.model.differential_drive import Array

TICK_S = 0.001
#: Posture in which an arm without a row around it begins: the survey posture (rad).
START = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])
_WHEEL_LAG_S = 0.05
_CLOSE_S = 0.2


class ArmBody(Protocol):
    """Seven joints. One thread moves them."""

    @property
    def q(self) -> Array:
        """Measured angles (7, rad)."""

    @property
    def dq(self) -> Array:
        """Measured velocities (7, rad/s)."""

    def move(self, velocity: Array) -> None:
        """Let a millisecond pass with these velocities commanded (7, rad/s)."""


class WheelBody(Protocol):
    """Two wheels, left and right."""

    @property
    def turned(self) -> Array:
        """Angles since the start (2, rad)."""

    @property
    def speed(self) -> Array:
        """Speeds (2, rad/s)."""

    @property
    def time(self) -> float:
        """Their own time (s)."""

    def drive(self, goal: Array, dt: float) -> None:
        """Go on for `dt` seconds with these speeds wanted (2, rad/s)."""


class BladeBody(Protocol):
    """The blades; called from threads that may wait."""

    @property
    def bites(self) -> int:
        """How often they have met."""

    def shut(self) -> str:
        """Close: empty when they have met, else what kept them from it."""

    def open(self) -> None:
        """Open, also in the middle of closing."""


class ExactArm:
    """Moves exactly as commanded."""

    def __init__(self) -> None:
        """At rest in the start posture."""
        self.q: Array = START.copy()
        self.dq: Array = np.zeros(7)

    def move(self, velocity: Array) -> None:
        """Go on with constant acceleration to the new velocity."""
        self.q = self.q + 0.5 * (velocity + self.dq) * TICK_S
        self.dq = velocity.copy()


class LaggingWheels:
    """Follow with a first-order lag, in the machine's own time."""

    def __init__(self) -> None:
        """At rest."""
        self.turned: Array = np.zeros(2)
        self.speed: Array = np.zeros(2)

    @property
    def time(self) -> float:
        """The machine's."""
        return time.monotonic()

    def drive(self, goal: Array, dt: float) -> None:
        """Go on towards the goal."""
        before = self.speed
        self.speed = before + (goal - before) * (1.0 - math.exp(-dt / _WHEEL_LAG_S))
        self.turned = self.turned + 0.5 * (before + self.speed) * dt


class AirBlades:
    """Close on nothing."""

    def __init__(self) -> None:
        """Open."""
        self.bites = 0
        self._opened = threading.Event()

    def shut(self) -> str:
        """Meet after a while, unless they are opened before."""
        self._opened.clear()
        if self._opened.wait(_CLOSE_S):
            return "opened before they met"
        self.bites += 1
        return ""

    def open(self) -> None:
        """At once."""
        self._opened.set()
