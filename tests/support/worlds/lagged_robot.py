"""A simulated robot without mass or contact: velocity servos with a first-order lag. For tests and benchmarks."""

from dataclasses import replace
from typing import Any

import numpy as np

from bridge.core.bridge import TICK_S
from bridge.core.interface import NO_CUT, Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.sim.robot.trace import ROW, Trace
from rolling_panda import reasons


class LaggedRobot:
    """Velocity servos with a first-order lag; every step is recorded as the simulator's trace records it."""

    def __init__(self, arm: tuple[float, ...]) -> None:
        """Stand at rest with the arm in this posture (7, rad)."""
        self.now = Measurement(np.array([0.0, 0.0, *arm]), np.zeros(9), "open", "", "", NO_CUT)
        self.rows: list[tuple[float, np.ndarray[Any, Any], np.ndarray[Any, Any], int, int]] = []
        #: Rows of the record at which a bridge started; the acceleration limit does not hold across them.
        self.begun: list[int] = []
        #: Fraction of its command that each actuator follows.
        self.follows = np.ones(9)
        self._gain = TICK_S / np.array([0.05] * 2 + [0.02] * 7)

    def read(self) -> Measurement:
        """The newest measurement."""
        return self.now

    def write(self, setpoint: Setpoint) -> None:
        """One step of 1 ms."""
        velocity = self.now.velocity + (self.follows * setpoint.xi - self.now.velocity) * self._gain
        self.now = replace(self.now, velocity=velocity, position=self.now.position + velocity * TICK_S)
        self.rows.append((setpoint.at, setpoint.xi, velocity, setpoint.epoch, setpoint.sequence))

    def cut(self, cut_id: str, point_id: str) -> None:
        """Cuts at once."""
        self.now = replace(self.now, cut_id=cut_id, outcome="DONE", detail=reasons.blades_met())

    def capture(self, expose: bool) -> Picture | None:
        """There is no camera."""
        return None

    def close(self) -> None:
        """Nothing to close."""

    def trace(self) -> Trace:
        """The record."""
        rows = np.zeros(len(self.rows), ROW)
        clocks, sent, velocity, epochs, sequences = zip(*self.rows, strict=True)
        rows["time"] = rows["clock"] = clocks
        rows["setpoint"], rows["velocity"] = np.array(sent), np.array(velocity)
        rows["epoch"], rows["sequence"] = epochs, sequences
        return Trace(rows, ())
