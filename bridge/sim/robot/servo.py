"""Velocity servos of wheels and arm, as torques.

They stand outside MuJoCo's own actuators on purpose: its implicit integration of stiff ones changes the wheels' speed
after the friction was solved for, and the base then slides by centimetres.
"""

import math

import numpy as np

from rolling_panda.model.differential_drive import Array

#: Time constant of the loop that makes a joint follow the lagged setpoint (s): well above a step of 1 ms.
LOOP_S = 0.010


class VelocityServos:
    """First-order lag on the setpoint, then a velocity loop with bounded torque."""

    def __init__(self, lag_s: Array, torque: Array, dt: float) -> None:
        """At rest.

        Args:
            lag_s: Time constant from setpoint to speed (n, s), of which `LOOP_S` is the loop itself.
            torque: Bound (n, N·m), on top of what compensates gravity.
            dt: Step (s).
        """
        self._blend = np.array([1.0 - math.exp(-dt / max(lag - LOOP_S, dt / 10)) for lag in lag_s])
        self._torque = torque
        self._speed = np.zeros_like(lag_s)

    def step(self, setpoint: Array, measured: Array, inertia: Array) -> Array:
        """Torques (n, N·m) towards a setpoint.

        Args:
            setpoint: Speeds asked for (n, rad/s).
            measured: Speeds (n, rad/s).
            inertia: What the servos have to move now (n×n, kg·m²): with it the joints do not disturb each other.
        """
        self._speed += self._blend * (setpoint - self._speed)
        wanted = inertia @ (self._speed - measured) / LOOP_S
        bounded: Array = np.minimum(np.maximum(wanted, -self._torque), self._torque)
        return bounded
