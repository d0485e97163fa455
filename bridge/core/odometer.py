"""Odometry from wheels and, where it is known, the base's orientation, with configurable delay and noise."""

import math
from collections import deque

import numpy as np
from msgspec.structs import replace

from bridge.config import OdometryConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.interface import Measurement
from rolling_panda import messages as m
from rolling_panda.model.base_attitude import attitude_of
from rolling_panda.model.differential_drive import Array, DifferentialDrive
from rolling_panda.model.wire_values import planar_pose


class Odometer:
    """Integrates the wheels. Its output is delayed by `delay_s` and has white noise; the noise does not accumulate.

    With an orientation, the way of the wheels is laid along it: the heading is that of the gyroscope, and the base
    climbs. Times are in ticks of the bridge.
    """

    def __init__(
        self,
        drive: DifferentialDrive,
        config: OdometryConfig,
        tick_s: float,
        seed: int = 0,
        orientation: BaseOrientation | None = None,
    ) -> None:
        """Start at odom's origin.

        Args:
            drive: Geometry of the base.
            config: Delay and noise.
            tick_s: Length of a tick (s).
            seed: Of the noise.
            orientation: From inertial sensors; None where they are not used.
        """
        self._orientation = orientation
        self._attitude = None if orientation is None else m.BaseAttitude()
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

    @property
    def attitude(self) -> m.BaseAttitude | None:
        """How the base stands on the ground; None without an orientation."""
        return self._attitude

    def feel(self, measured: Measurement) -> None:
        """Take in the inertial sensors of a measurement that is not followed."""
        if self._orientation is not None:
            self._orientation.feel(measured.inertial)

    def follow(self, measured: Measurement, now: float) -> None:
        """Integrate up to a measurement at a time (s); the first one is the origin's."""
        wheels = measured.position[:2]
        left, right = (0.0, 0.0) if self._wheels is None else (wheels - self._wheels).tolist()
        self._wheels = wheels.copy()
        if self._orientation is None or self._attitude is None:
            self._pose = self._drive.integrate(self._pose, left, right)
            return
        way, turned = self._drive.twist(left, right)
        R = self._orientation.update(measured.inertial, measured.position, measured.velocity, turned, now)
        attitude, heading = attitude_of(R, self._attitude.height + float(R[2, 0]) * way)
        self._attitude = replace(attitude, measured=self._orientation.measured)
        # The forward axis of a base that climbs is shorter on the plane.
        level = way * float(np.hypot(R[0, 0], R[1, 0]))
        turned = math.remainder(heading - float(self._pose[2]), math.tau)
        left, right = self._drive.wheels(level, turned)
        self._pose = self._drive.integrate(self._pose, left, right)

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
            attitude=self._attitude,
        )
        self._waiting.append((ticks + self._delay, message))

    def due(self, ticks: int) -> m.Odometry | None:
        """The measurement whose delay is over, each once."""
        if self._waiting and self._waiting[0][0] <= ticks:
            return self._waiting.popleft()[1]
        return None
