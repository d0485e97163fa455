"""One physics behind all fakes: the simulated robot beside its row, which the fake devices move and look at."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.fakes.bodies import TICK_S
from bridge.sim.robot.robot import SimulatedRobot
from rolling_panda.model.differential_drive import Array

_PICTURE_TICKS = 10
# However slow the machine: the blades take a third of a second of the robot's own time.
_BITE_S = 10.0

#: Is given a picture and the machine's time (s since 1970) at which it was exposed.
TakePicture = Callable[[Picture, float], None]


class VineyardPlant:
    """Arm, wheels and blades of one simulated robot. The arm's thread lets time pass; the others look and order."""

    def __init__(self, robot: SimulatedRobot, picture_hz: float, take: TakePicture) -> None:
        """Stand still.

        Args:
            robot: Closed with the plant.
            picture_hz: Exposures a second of the robot's time.
            take: Is given each picture, in the arm's thread.
        """
        self._robot, self._take = robot, take
        self._period = round(1 / picture_hz / TICK_S)
        self._ticks, self._exposed, self._exposed_at = 0, -self._period, 0.0
        self._waiting = False
        self._goal = np.zeros(2)
        self._measured = _own(robot.read())
        self._number = 0
        self._ordered = ""
        self._blades = False
        self._lock = threading.Lock()
        self.bites = 0

    @property
    def q(self) -> Array:
        """Of the arm (7, rad)."""
        return self._measured.position[2:]

    @property
    def dq(self) -> Array:
        """Of the arm (7, rad/s)."""
        return self._measured.velocity[2:]

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
        """The physics go on by a millisecond, with the arm's joints commanded so (7, rad/s)."""
        with self._lock:
            ordered, self._ordered = self._ordered, ""
            blades = self._blades
        if ordered:
            self._robot.cut(ordered, "")
        xi = np.concatenate([self._goal, velocity])
        self._robot.write(Setpoint(xi, blades, 0, self._ticks, time.monotonic()))
        self._measured = _own(self._robot.read())
        self._ticks += 1
        if self._ticks % _PICTURE_TICKS == 0:
            self._photograph()

    def drive(self, goal: Array, dt: float) -> None:
        """The wheels' servos are given these speeds (2, rad/s)."""
        self._goal = goal.copy()

    def shut(self) -> str:
        """Close the blades on what is between them; empty when they have met."""
        with self._lock:
            self._number += 1
            name = f"bite-{self._number}"
            self._ordered, self._blades = name, True
        end = time.monotonic() + _BITE_S
        while not ((now := self._measured).cut_id == name and now.outcome):
            if time.monotonic() > end:
                return "the blades have not met"
            time.sleep(TICK_S)
        # Blades know whether they have met, not whether anything was between them.
        if now.cutter == "jammed" or not self._blades:
            return now.detail
        self.bites += 1
        return ""

    def open(self) -> None:
        """Blades that close open again."""
        with self._lock:
            self._blades = False

    def close(self) -> None:
        """End the physics."""
        self._robot.close()

    def _photograph(self) -> None:
        expose = not self._waiting and self._ticks - self._exposed >= self._period
        if expose:
            self._waiting, self._exposed, self._exposed_at = True, self._ticks, time.time()
        picture = self._robot.capture(expose)
        if picture is not None:
            self._waiting = False
            self._take(picture, self._exposed_at)


def _own(measured: Measurement) -> Measurement:
    # The simulated robot's own arrays change under whoever reads them in another thread.
    return replace(measured, position=measured.position.copy(), velocity=measured.velocity.copy())
