"""Mechanics behind the fake devices: interfaces of arm, wheels and blades, and ideal ones."""

import math
import threading
import time
from typing import Protocol

import numpy as np

from rolling_panda.model.differential_drive import Array

TICK_S = 0.001
#: Start posture of an arm without a row: the survey posture (rad).
START = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])
_WHEEL_LAG_S = 0.05
_CLOSE_S = 0.2


class ArmBody(Protocol):
    """Seven joints, moved by one thread."""

    @property
    def q(self) -> Array:
        """Measured angles (7, rad)."""

    @property
    def dq(self) -> Array:
        """Measured velocities (7, rad/s)."""

    @property
    def external_torque(self) -> Array:
        """Estimated torques by what touches the arm (7, N·m)."""

    def move(self, velocity: Array) -> None:
        """Advance by a millisecond with commanded velocities (7, rad/s)."""


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
        """Time of the wheels (s)."""

    def drive(self, goal: Array, dt: float) -> None:
        """Advance by `dt` (s) with target speeds (2, rad/s)."""


class BladeBody(Protocol):
    """The blades; the calling threads may block."""

    @property
    def closures(self) -> int:
        """Number of completed closures."""

    def shut(self) -> str:
        """Close; empty on success, else the reason."""

    def open(self) -> None:
        """Open, even while closing."""


class IdealArm:
    """An arm that moves exactly as commanded."""

    def __init__(self) -> None:
        """At rest in the start posture."""
        self.q: Array = START.copy()
        self.dq: Array = np.zeros(7)
        self.external_torque: Array = np.zeros(7)

    def move(self, velocity: Array) -> None:
        """Advance with constant acceleration to the new velocity."""
        self.q = self.q + 0.5 * (velocity + self.dq) * TICK_S
        self.dq = velocity.copy()


class FirstOrderWheels:
    """Wheels with a first-order lag, in real time."""

    def __init__(self) -> None:
        """At rest."""
        self.turned: Array = np.zeros(2)
        self.speed: Array = np.zeros(2)

    @property
    def time(self) -> float:
        """Real time (s)."""
        return time.monotonic()

    def drive(self, goal: Array, dt: float) -> None:
        """Advance towards the target speeds."""
        before = self.speed
        self.speed = before + (goal - before) * (1.0 - math.exp(-dt / _WHEEL_LAG_S))
        self.turned = self.turned + 0.5 * (before + self.speed) * dt


class FreeBlades:
    """Blades with nothing between them."""

    def __init__(self) -> None:
        """Open."""
        self.closures = 0
        self._opened = threading.Event()

    def shut(self) -> str:
        """Close after a while, unless they are opened before."""
        self._opened.clear()
        if self._opened.wait(_CLOSE_S):
            return "opened before they met"
        self.closures += 1
        return ""

    def open(self) -> None:
        """Open at once."""
        self._opened.set()
