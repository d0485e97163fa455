"""Calibrated wheels: everything above the bridge sees wheels as drawn, whatever the robot's real ones are.

Angles of the real wheels are turned into those that wheels as drawn would have turned by on the same way of the base,
and commands the other way. Odometry and commands thus agree with the ground, and no other process has to know.
"""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from bridge.core.interface import Measurement
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.calibration.file import FARTHEST_WHEELS, plausible
from rolling_panda.model.differential_drive import Array, WheelSizes

#: Keeps a calibration beyond a restart, on another thread; the future raises OSError where it cannot.
Keep = Callable[[m.BaseCalibration], "Future[None]"]


def forget(base: m.BaseCalibration) -> "Future[None]":
    """For a bridge without a state folder."""
    done: Future[None] = Future()
    done.set_result(None)
    return done


class WheelCalibration:
    """Converts between the real wheels and those drawn. Not thread-safe."""

    def __init__(
        self, drawn: WheelSizes, fastest: float, base: m.BaseCalibration | None = None, keep: Keep = forget
    ) -> None:
        """Use a calibration.

        Args:
            drawn: The wheels that all other processes know.
            fastest: Limit of a wheel (rad/s), which no conversion exceeds.
            base: Of an earlier start; None takes the wheels to be as drawn.
            keep: Called with a new one before it is used.
        """
        self._drawn, self._fastest, self._keep = drawn, fastest, keep
        self._real: Array | None = None
        self._shown = np.zeros(2)
        self._pending: tuple[m.BaseCalibration, Future[None]] | None = None
        self.base: m.BaseCalibration | None = None
        self._take(base)

    def _take(self, base: m.BaseCalibration | None) -> None:
        self.base = base
        self._used = self._drawn if base is None else WheelSizes(base.left, base.right, base.track)
        self._to_drawn = np.asarray(np.linalg.solve(self._drawn.motion(), self._used.motion()), np.float64)
        self._to_real = np.asarray(np.linalg.inv(self._to_drawn), np.float64)

    @property
    def sizes(self) -> tuple[float, float, float] | None:
        """Both radii and the track in use (m); None for those drawn."""
        return None if self.base is None else (self._used.left, self._used.right, self._used.track)

    def measured(self, measurement: Measurement) -> Measurement:
        """A measurement of the robot, with wheels as drawn. Their angles go on where they were."""
        real = measurement.position[:2].copy()
        if self._real is None:
            self._shown = real
        else:
            turned = real - self._real
            self._shown = self._shown + (turned if self.base is None else self._to_drawn @ turned)
        self._real = real
        if self.base is None:
            return measurement
        position, velocity = measurement.position.copy(), measurement.velocity.copy()
        position[:2], velocity[:2] = self._shown, self._to_drawn @ velocity[:2]
        return replace(measurement, position=position, velocity=velocity)

    def commanded(self, xi: Array) -> Array:
        """Velocities for the robot (9, rad/s) from those of a robot with wheels as drawn."""
        if self.base is None:
            return xi
        wheels = self._to_real @ xi[:2]
        out = xi.copy()
        # Both wheels alike, so that the base keeps its curve.
        out[:2] = wheels * min(1.0, self._fastest / max(float(np.abs(wheels).max()), 1e-9))
        return out

    def request(self, base: m.BaseCalibration) -> m.Reason | None:
        """Keep a new calibration, and use it once it is kept; returns why not."""
        if self._pending is not None:
            return reasons.calibration_under_way()
        if not plausible(base, self._drawn):
            return reasons.calibration_of_other_wheels(100 * FARTHEST_WHEELS)
        self._pending = base, self._keep(base)
        return None

    def kept(self, at_rest: bool) -> m.Reason | None:
        """What has become of a requested calibration, once; None before that. It is taken into use at rest.

        Args:
            at_rest: Whether nothing moves the robot.
        """
        if self._pending is None or not self._pending[1].done():
            return None
        base, future = self._pending
        failed = future.exception()
        if failed is not None:
            self._pending = None
            return reasons.calibration_not_kept(getattr(failed, "strerror", None) or str(failed))
        if not at_rest:
            return None
        self._pending = None
        before = self._used
        self._take(base)
        radius = (base.left + base.right) / (before.left + before.right)
        return reasons.base_calibration_used(100 * (radius - 1.0), 100 * (base.track / before.track - 1.0))
