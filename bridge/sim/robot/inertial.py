"""The camera's gyroscope and accelerometer: MuJoCo's, with bias and noise."""

from typing import Any

import numpy as np

from bridge.core.attitude import Inertial
from rolling_panda.model.differential_drive import Array

GYROSCOPE, ACCELEROMETER = "gyroscope", "accelerometer"
#: Bias (SD, rad/s and m/s²) after the vendor's calibration: estimates. Bosch's BMI055 alone has up to 0.017 and 0.7.
_RATE_BIAS, _FORCE_BIAS = 0.005, 0.05
#: Scale of each axis of the gyroscope (SD): an estimate; the BMI055 alone has up to 0.01.
_RATE_SCALE = 0.003
#: White noise of the BMI055 (rad/s and m/s², SD): 0.014 °/s and 150 µg per root of a hertz, at 100 Hz.
_RATE_NOISE, _FORCE_NOISE = 0.0024, 0.015


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

    def sample(self, data: Any) -> Inertial:
        """What they measure now; `data` is MuJoCo's."""
        off = self._bias + self._noise * self._random.standard_normal(6)
        rate, force = data.sensor(GYROSCOPE).data, data.sensor(ACCELEROMETER).data
        return Inertial(float(data.time), self._scale * (self._R @ rate) + off[:3], self._R @ force + off[3:])
