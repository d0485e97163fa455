"""Odometry from wheel measurements, with configurable delay and noise."""

from collections import deque

import numpy as np

from bridge.config import OdometryConfig
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import Array, DifferentialDrive
from rolling_panda.model.wire_values import planar_pose


class Odometer:
    """Integrates the wheels. Its output is delayed by `delay_s` and has white noise; the noise does not accumulate.

    Times are in ticks of the bridge.
    """

    def __init__(self, drive: DifferentialDrive, config: OdometryConfig, tick_s: float, seed: int = 0) -> None:
        """Start at odom's origin.

        Args:
            drive: Geometry of the base.
            config: Delay and noise.
            tick_s: Length of a tick (s).
            seed: Of the noise.
        """
        self._drive, self._config = drive, config
        self._delay = round(config.delay_s / tick_s)
        self._random = np.random.default_rng([seed, 0x0D0])
        self._pose = np.zeros(3)
        self._wheels: Array | None = None
        self._waiting: deque[tuple[int, m.Odometry]] = deque()
        self._sequence = 0

    @property
    def pose(self) -> m.PlanarPose:
        """Pose of the base from the wheels, without delay and noise."""
        return planar_pose(self._pose)

    @property
    def drive(self) -> DifferentialDrive:
        """Geometry of the base, as drawn."""
        return self._drive

    def follow(self, wheels: Array) -> None:
        """Integrate up to these wheel angles (2, rad); the first ones are the origin's."""
        if self._wheels is not None:
            left, right = wheels - self._wheels
            self._pose = self._drive.integrate(self._pose, float(left), float(right))
        self._wheels = wheels.copy()

    def measure(self, ticks: int, stamp: float, speeds: Array) -> None:
        """Take a measurement, stamped with when it is true, that goes out after the delay.

        Args:
            ticks: Now.
            stamp: The same for the receiver (s).
            speeds: Of the wheels (2, rad/s).
        """
        config, noise = self._config, self._random.standard_normal(5)
        linear, angular = self._drive.twist(float(speeds[0]), float(speeds[1]))
        self._sequence += 1
        pose = self._pose + noise[:3] * [config.position_noise, config.position_noise, config.heading_noise]
        message = m.Odometry(
            header=m.Header(stamp, "odom"),
            sequence=self._sequence,
            pose=planar_pose(pose),
            linear=linear + float(noise[3]) * config.linear_noise,
            angular=angular + float(noise[4]) * config.angular_noise,
        )
        self._waiting.append((ticks + self._delay, message))

    def due(self, ticks: int) -> m.Odometry | None:
        """The measurement whose delay is over, each once."""
        if self._waiting and self._waiting[0][0] <= ticks:
            return self._waiting.popleft()[1]
        return None
