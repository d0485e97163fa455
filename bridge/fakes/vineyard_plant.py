"""The simulated robot behind the fake devices."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bridge.core.attitude import Inertial
from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.fakes.bodies import TICK_S
from bridge.sim.robot.robot import SimulatedRobot
from rolling_panda.model.differential_drive import Array
from rolling_panda.reasons import text_of

_PICTURE_TICKS, _INERTIAL_TICKS = 10, 5
# For a slow machine: the blades take a third of a second of simulated time.
_CLOSE_TIMEOUT_S = 10.0

#: Called with a picture and the Unix time of its exposure (s).
PictureCallback = Callable[[Picture, float], None]
#: Called with each sample of the inertial sensors.
InertialCallback = Callable[[Inertial], None]


class VineyardPlant:
    """Arm, wheels and blades of one simulated robot. The arm's thread advances time; other threads read and command."""

    def __init__(
        self, robot: SimulatedRobot, picture_hz: float, on_picture: PictureCallback, on_inertial: InertialCallback
    ) -> None:
        """Start at rest.

        Args:
            robot: Closed with the plant.
            picture_hz: Rate of exposures in simulated time.
            on_picture: Called with each picture, in the arm's thread.
            on_inertial: The same with each inertial sample, where the robot has such sensors.
        """
        self._robot, self._on_picture, self._on_inertial = robot, on_picture, on_inertial
        self._period = round(1 / picture_hz / TICK_S)
        self._ticks, self._exposed, self._exposed_at = 0, -self._period, 0.0
        self._waiting = False
        self._goal = np.zeros(2)
        self._measured = _own(robot.read())
        self._number = 0
        self._requested_cut = ""
        self._blades = False
        self._lock = threading.Lock()
        self.closures = 0

    @property
    def q(self) -> Array:
        """Of the arm (7, rad)."""
        return self._measured.position[2:]

    @property
    def dq(self) -> Array:
        """Of the arm (7, rad/s)."""
        return self._measured.velocity[2:]

    @property
    def external_torque(self) -> Array:
        """Of the arm, as it estimates it (7, N·m)."""
        torque = self._measured.external_torque
        return np.zeros(7) if torque is None else torque

    @property
    def turned(self) -> Array:
        """Of the wheels (2, rad)."""
        return self._measured.position[:2]

    @property
    def speed(self) -> Array:
        """Of the wheels (2, rad/s)."""
        return self._measured.velocity[:2]

    @property
    def time(self) -> float:
        """Simulated (s)."""
        return self._robot.time

    def move(self, velocity: Array) -> None:
        """Advance the physics by a millisecond, with commanded joint velocities (7, rad/s)."""
        with self._lock:
            requested, self._requested_cut = self._requested_cut, ""
            blades = self._blades
        if requested:
            self._robot.cut(requested, "")
        xi = np.concatenate([self._goal, velocity])
        self._robot.write(Setpoint(xi, blades, 0, self._ticks, time.monotonic()))
        self._measured = _own(self._robot.read())
        self._ticks += 1
        if self._ticks % _PICTURE_TICKS == 0:
            self._capture()
        if self._ticks % _INERTIAL_TICKS == 0 and self._measured.inertial is not None:
            self._on_inertial(self._measured.inertial)

    def drive(self, goal: Array, dt: float) -> None:
        """Set the target speeds of the wheels (2, rad/s)."""
        self._goal = goal.copy()

    def shut(self) -> str:
        """Close the blades; empty on success, else the reason."""
        with self._lock:
            self._number += 1
            name = f"cut-{self._number}"
            self._requested_cut, self._blades = name, True
        end = time.monotonic() + _CLOSE_TIMEOUT_S
        while not ((now := self._measured).cut_id == name and now.outcome):
            if time.monotonic() > end:
                return "the blades have not met"
            time.sleep(TICK_S)
        # Real blades report closure, not whether anything was cut.
        if now.cutter == "jammed" or not self._blades:
            return text_of(now.detail)
        self.closures += 1
        return ""

    def open(self) -> None:
        """Open the blades, even while closing."""
        with self._lock:
            self._blades = False

    def close(self) -> None:
        """Close the robot."""
        self._robot.close()

    def _capture(self) -> None:
        expose = not self._waiting and self._ticks - self._exposed >= self._period
        if expose:
            self._waiting, self._exposed, self._exposed_at = True, self._ticks, time.time()
        picture = self._robot.capture(expose)
        if picture is not None:
            self._waiting = False
            self._on_picture(picture, self._exposed_at)


def _own(measured: Measurement) -> Measurement:
    # Copies for other threads: the robot's arrays change in place.
    return replace(measured, position=measured.position.copy(), velocity=measured.velocity.copy())
