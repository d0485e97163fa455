"""Calibrated wheels, joints and camera clock: above the bridge the robot is as drawn, whatever the real one is like.

Angles of the real wheels are turned into those that wheels as drawn would have turned by on the same way of the base,
and commands the other way. The offset of each joint's encoder is taken from its angle; a velocity has none. Odometry,
postures and commands thus agree with the world, and no other process has to know. A camera frame gets the posture of
when it was exposed.
"""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from bridge.core.interface import Measurement
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.calibration.file import DAY_S, FARTHEST_WHEELS, OLD_S, Calibrated, plausible
from rolling_panda.model.differential_drive import Array, WheelSizes

#: Keeps a calibration beyond a restart, on another thread; the future raises OSError where it cannot.
Keep = Callable[[m.AnyCalibration], "Future[None]"]
AS_DRAWN = Calibrated()


def forget(calibration: m.AnyCalibration) -> "Future[None]":
    """For a bridge without a state folder."""
    done: Future[None] = Future()
    done.set_result(None)
    return done


class Calibration:
    """Converts between the real robot and the one that is drawn. Not thread-safe."""

    def __init__(
        self, drawn: WheelSizes, fastest: float, calibrated: Calibrated = AS_DRAWN, keep: Keep = forget
    ) -> None:
        """Use the calibrations of an earlier start.

        Args:
            drawn: The wheels that all other processes know.
            fastest: Limit of a wheel (rad/s), which no conversion exceeds.
            calibrated: Of an earlier start.
            keep: Called with a new one before it is used.
        """
        self._drawn, self._fastest, self._keep = drawn, fastest, keep
        self._real: Array | None = None
        self._shown = np.zeros(2)
        self._pending: tuple[m.AnyCalibration, Future[None]] | None = None
        self.base: m.BaseCalibration | None = None
        self.arm: m.ArmCalibration | None = None
        self.timing: m.FrameTiming | None = None
        self._take(calibrated.base)
        self._take(calibrated.arm)
        self._take(calibrated.timing)

    def _take(self, calibration: m.AnyCalibration | None) -> None:
        if isinstance(calibration, m.BaseCalibration):
            self.base = calibration
        elif isinstance(calibration, m.FrameTiming):
            self.timing = calibration
        elif calibration is not None:
            self.arm = calibration
        base = self.base
        self._used = self._drawn if base is None else WheelSizes(base.left, base.right, base.track)
        self._to_drawn = np.asarray(np.linalg.solve(self._drawn.motion(), self._used.motion()), np.float64)
        self._to_real = np.asarray(np.linalg.inv(self._to_drawn), np.float64)
        self._offsets = np.array(self.joint_offsets)

    @property
    def sizes(self) -> tuple[float, float, float] | None:
        """Both radii and the track in use (m); None for those drawn."""
        return None if self.base is None else (self._used.left, self._used.right, self._used.track)

    @property
    def joint_offsets(self) -> m.JointOffsets:
        """What is taken from the encoders of the joints (rad)."""
        return m.NO_OFFSETS if self.arm is None else self.arm.offsets

    def warnings(self, wall_time: float) -> tuple[m.Reason, ...]:
        """Which calibrations in use are old at a time of day (s since 1970), in whole days."""
        used = (
            (self.base, reasons.base_calibration_old),
            (self.arm, reasons.arm_calibration_old),
            (self.timing, reasons.timing_calibration_old),
        )
        told = []
        for each, old in used:
            if each is not None and (age := wall_time - each.made_at) > OLD_S:
                told.append(old(age // DAY_S))
        return tuple(told)

    def own_angles(self, arm: Array) -> Array:
        """Angles of the joints by their own encoders (7, rad), in which their limits hold, from those as drawn."""
        return arm if self.arm is None else arm + self._offsets

    def measured(self, measurement: Measurement) -> Measurement:
        """A measurement of the robot, with wheels and joints as drawn. Angles of wheels go on where they were."""
        real = measurement.position[:2].copy()
        if self._real is None:
            self._shown = real
        else:
            turned = real - self._real
            self._shown = self._shown + (turned if self.base is None else self._to_drawn @ turned)
        self._real = real
        if self.base is None and self.arm is None:
            return measurement
        position, velocity = measurement.position.copy(), measurement.velocity.copy()
        position[2:] -= self._offsets
        if self.base is not None:
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

    def request(self, calibration: m.AnyCalibration) -> m.Reason | None:
        """Keep a new calibration, and use it once it is kept; returns why not."""
        if self._pending is not None:
            return reasons.calibration_under_way()
        if isinstance(calibration, m.BaseCalibration) and not plausible(calibration, self._drawn):
            return reasons.calibration_of_other_wheels(100 * FARTHEST_WHEELS)
        self._pending = calibration, self._keep(calibration)
        return None

    def kept(self, at_rest: bool) -> m.Reason | None:
        """What has become of a requested calibration, once; None before that. It is taken into use at rest.

        Args:
            at_rest: Whether nothing moves the robot.
        """
        if self._pending is None or not self._pending[1].done():
            return None
        calibration, future = self._pending
        failed = future.exception()
        if failed is not None:
            self._pending = None
            return reasons.calibration_not_kept(getattr(failed, "strerror", None) or str(failed))
        if not at_rest:
            return None
        self._pending = None
        before, offsets = self._used, self._offsets
        self._take(calibration)
        if isinstance(calibration, m.FrameTiming):
            return reasons.timing_calibration_used(1e3 * calibration.delay)
        if isinstance(calibration, m.ArmCalibration):
            return reasons.arm_calibration_used(float(np.degrees(np.abs(self._offsets - offsets).max())))
        radius = (self._used.left + self._used.right) / (before.left + before.right)
        return reasons.base_calibration_used(100 * (radius - 1.0), 100 * (self._used.track / before.track - 1.0))
