"""The real robot behind the bridge's interface: base, arm, cutter and camera."""

from functools import reduce
from typing import Protocol

import numpy as np

from bridge.core.attitude import Inertial
from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.real.arm_link import ArmState
from bridge.real.cutter import CutterStatus
from bridge.real.mp500 import BaseState
from rolling_panda import reasons
from rolling_panda.model.differential_drive import Array

READ_ONLY = reasons.bridge_reads_only()


class Base(Protocol):
    """Interface of `bridge.real.mp500.Mp500`."""

    def read(self) -> BaseState:
        """The newest state."""

    def write(self, wheels: Array) -> None:
        """Speeds of the wheels (2, rad/s), until its deadline."""

    def release(self) -> object:
        """A person lets it go on."""

    def close(self) -> None:
        """Let go."""


class Arm(Protocol):
    """Interface of `bridge.real.panda.Panda`."""

    def read(self) -> ArmState:
        """The newest state."""

    def write(self, velocity: Array) -> None:
        """Velocities of the joints (7, rad/s), until its deadline."""

    def release(self) -> None:
        """A person lets it go on."""

    def close(self) -> None:
        """Let go."""


class Blades(Protocol):
    """Interface of `bridge.real.cutter.Cutter`."""

    def read(self) -> CutterStatus:
        """State of the blades."""

    def enable(self, blades: bool) -> None:
        """Whether they may close."""

    def cut(self, cut_id: str) -> None:
        """Begin to close."""

    def close(self) -> None:
        """Let go."""


class Camera(Protocol):
    """Interface of `bridge.real.realsense.RealSense`."""

    def capture(self, expose: bool) -> Picture | None:
        """Ask for a picture, or fetch one."""

    def inertial(self) -> Inertial | None:
        """The newest sample of its inertial sensors; None without them."""

    def close(self) -> None:
        """Let go."""


class RealRobot:
    """Implements `bridge.core.interface.Robot`; no call blocks."""

    def __init__(self, base: Base, arm: Arm, blades: Blades, camera: Camera | None, moving: bool = True) -> None:
        """Assemble connected devices.

        Args:
            base: The base.
            arm: The arm.
            blades: The cutter.
            camera: The camera; None on a robot without one.
            moving: False reads only: nothing is sent to any device, and the robot reports that as its fault.
        """
        self._base, self._arm, self._blades, self._camera = base, arm, blades, camera
        self._moving, self._releases = moving, 0

    def read(self) -> Measurement:
        """The newest of every device; a fault of one is a fault of the robot."""
        base, arm, blades = self._base.read(), self._arm.read(), self._blades.read()
        faults = [fault for fault in (None if self._moving else READ_ONLY, base.fault, arm.fault) if fault is not None]
        return Measurement(
            np.concatenate([base.position, arm.position]),
            np.concatenate([base.velocity, arm.velocity]),
            blades.state,
            blades.cut_id,
            blades.outcome,
            blades.detail,
            fault=reduce(reasons.both, faults) if faults else None,
            severe=base.severe or arm.severe,
            emergency=base.emergency,
            battery=_fraction(base.battery),
            arm_success=_fraction(arm.success_rate) if arm.commands > 0 else None,
            external_torque=arm.external_torque,
            inertial=None if self._camera is None else self._camera.inertial(),
        )

    def write(self, setpoint: Setpoint) -> None:
        """Hand the setpoint to every device; they follow it at their own rates until their own deadlines."""
        if not self._moving:
            return
        if setpoint.releases > self._releases:
            self._releases = setpoint.releases
            self._base.release()
            self._arm.release()
        self._base.write(setpoint.xi[:2])
        self._arm.write(setpoint.xi[2:])
        self._blades.enable(setpoint.blades)

    def cut(self, cut_id: str, point_id: str) -> None:
        """Begin to close the blades."""
        self._blades.cut(cut_id)

    def capture(self, expose: bool) -> Picture | None:
        """Ask the camera for a picture, or fetch the one that is ready."""
        return None if self._camera is None else self._camera.capture(expose)

    def close(self) -> None:
        """Let go of every device."""
        self._blades.close()
        self._base.close()
        self._arm.close()
        if self._camera is not None:
            self._camera.close()


def _fraction(value: float) -> float | None:
    """A fraction that a device tells; None where it is not one, as before the first."""
    return value if 0.0 <= value <= 1.0 else None
