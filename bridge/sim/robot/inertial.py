"""The camera's gyroscope and accelerometer, with bias and noise.

A real sensor filters vibration that is faster than its samples, as of blades that rub on wood. So a sample here holds
the rotation since the sample before, and the mean force.
"""

from typing import Any

import numpy as np
import pinocchio as pin

from bridge.core.attitude import Inertial
from rolling_panda.model.differential_drive import Array

#: MuJoCo's sensor.
ACCELEROMETER = "accelerometer"
#: Bias (SD, rad/s and m/s²) after the vendor's calibration: estimates. Bosch's BMI055 alone has up to 0.017 and 0.7.
_RATE_BIAS, _FORCE_BIAS = 0.005, 0.05
#: Scale of each axis of the gyroscope (SD): an estimate; the BMI055 alone has up to 0.01.
_RATE_SCALE = 0.003
#: White noise of the BMI055 (rad/s and m/s², SD): 0.014 °/s and 150 µg per root of a hertz, at 200 Hz.
_RATE_NOISE, _FORCE_NOISE = 0.0034, 0.021
#: Time between two samples (s).
_SAMPLE_S = 0.005


class InertialSensors:
    """Both sensors of one camera."""

    def __init__(self, errors: float, R_site_camera: Array, seed: int) -> None:
        """Draw the biases.

        Args:
            errors: Bias and noise as multiples of the usual ones.
            R_site_camera: Rotation of the true camera on the one that the model has (3×3).
            seed: Of bias and noise.
        """
        self._R = R_site_camera.T
        self._random = np.random.default_rng([seed, 0x0141])
        scale = errors * np.repeat([_RATE_BIAS, _FORCE_BIAS], 3)
        self._bias = scale * self._random.standard_normal(6)
        self._scale = 1.0 + errors * _RATE_SCALE * self._random.standard_normal(3)
        self._noise = errors * np.repeat([_RATE_NOISE, _FORCE_NOISE], 3)
        self._force, self._steps = np.zeros(3), 0
        #: Time and rotation R_world_site of the last sample.
        self._last: tuple[float, Array] | None = None
        #: The newest sample; None before the second one.
        self.newest: Inertial | None = None

    def follow(self, data: Any) -> None:
        """Take in a physics step; `data` is MuJoCo's."""
        self._force = self._force + data.sensor(ACCELEROMETER).data
        self._steps += 1

    def due(self, time: float) -> bool:
        """Whether there is a new sample at a time (s)."""
        return self._steps > 0 and (self._last is None or time - self._last[0] > _SAMPLE_S - 1e-6)

    def sample(self, time: float, R_world_site: Array) -> None:
        """Take a sample."""
        last = self._last
        self._last, force = (time, R_world_site.copy()), self._force / self._steps
        self._force, self._steps = np.zeros(3), 0
        if last is not None:
            rate = pin.log3(last[1].T @ R_world_site) / (time - last[0])
            off = self._bias + self._noise * self._random.standard_normal(6)
            self.newest = Inertial(time, self._scale * (self._R @ rate) + off[:3], self._R @ force + off[3:])
