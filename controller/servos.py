"""A robot that does as it is told, late: its actuators follow their velocities with a first-order lag."""

import math

import numpy as np

from rolling_panda.differential_drive import NXI, Array, DifferentialDrive


class Servos:
    """Where the robot goes by what is sent. `step` it once a control period."""

    def __init__(self, drive: DifferentialDrive, q: Array, wheel_lag_s: float, arm_lag_s: float, dt: float) -> None:
        """At rest.

        Args:
            drive: Of the base.
            q: Configuration (12).
            wheel_lag_s: Time constant of the wheels (s).
            arm_lag_s: Of the arm's joints (s).
            dt: Control period (s).
        """
        self._drive, self._dt = drive, dt
        self.q, self.xi = q.copy(), np.zeros(NXI)
        lags = (*[wheel_lag_s] * 2, *[arm_lag_s] * (NXI - 2))
        self._left = np.array([math.exp(-dt / lag) if lag > 0.0 else 0.0 for lag in lags])
        self._late = np.array(lags) * (1.0 - self._left)

    def step(self, command: Array) -> None:
        """One period with ξ̇ (9, rad/s) sent at its beginning."""
        behind = self.xi - command
        turned = command * self._dt + behind * self._late
        self.xi = command + behind * self._left
        self.q[:3] = self._drive.integrate(self.q[:3], float(turned[0]), float(turned[1]))
        self.q[3:] += turned
