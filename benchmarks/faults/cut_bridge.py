"""The bridge with a robot without mass and blades in a process of their own: `python -m benchmarks.faults.cut_bridge`.

Everything but the robot behind it is the product's: gate, watchdog, latch, memory of cuts and tokens, loop and wire.
The robot's posture is in a file, where the next start finds it: a robot does not go home when its bridge is killed.
"""

import argparse
import gc
import json
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bridge.config import BridgeConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.cut_orders import CutFile
from bridge.core.interface import CutterState, Measurement, Setpoint
from bridge.core.odometer import Odometer
from bridge.core.picture import Picture
from bridge.core.state_memory import open_memory
from bridge.loop import bridge_runner
from controller.config import ControllerConfig
from rolling_panda import reasons
from rolling_panda.config import load_section
from rolling_panda.messages.types import Outcome
from rolling_panda.model.robot import RobotModel
from rolling_panda.runtime.process import ProcessContext, run_process
from rolling_panda.runtime.state_folder import alone

#: Time constant of every velocity servo (s).
_LAG_S = 0.02


class BladesApart:
    """A `Robot` of the bridge: velocities follow with a lag, the blades are those of `benchmarks.faults.cut_plant`."""

    def __init__(self, plant: Path, posture: Path) -> None:
        """Connect to the plant; the posture's file is made where there is none."""
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(str(plant))
        self._socket.setblocking(False)
        new = not posture.exists()
        self._position = np.memmap(posture, float, "w+" if new else "r+", shape=(9,))
        if new:
            self._position[2:] = ControllerConfig().work.home
        self._velocity = np.zeros(9)
        self._cutter: CutterState = "open"
        self._cut_id, self._rest = "", b""
        self._outcome: Outcome = ""

    def read(self) -> Measurement:
        """The newest measurement."""
        return Measurement(
            np.array(self._position),
            self._velocity.copy(),
            self._cutter,
            self._cut_id,
            self._outcome,
            reasons.blades_met(),
        )

    def write(self, setpoint: Setpoint) -> None:
        """Let 1 ms pass."""
        self._velocity += (setpoint.xi - self._velocity) * (TICK_S / _LAG_S)
        self._position += self._velocity * TICK_S
        if self._cutter == "closing" and not setpoint.blades:
            self._order("open")
        self._hear()

    def cut(self, cut_id: str, point_id: str) -> None:
        """Begin to close."""
        self._cut_id, self._outcome, self._cutter = cut_id, "", "closing"
        self._order("cut", point_id)

    def capture(self, expose: bool) -> Picture | None:
        """There is no camera: perception is played."""
        return None

    def close(self) -> None:
        """Let go of the plant."""
        self._socket.close()

    def _order(self, order: str, point_id: str = "") -> None:
        words = {"order": order, "cut_id": self._cut_id, "point_id": point_id}
        self._socket.send(json.dumps(words).encode() + b"\n")

    def _hear(self) -> None:
        try:
            data = self._socket.recv(4096)
        except BlockingIOError:
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            told = json.loads(line)
            if told["cut_id"] == self._cut_id:
                self._outcome, self._cutter = told["outcome"], "open"


def main(argv: Sequence[str] | None = None) -> int:
    """Run it; returns the exit code."""
    return run_process("bridge", "The bridge with blades of their own.", _run, _arguments, argv)


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--plant", type=Path, required=True, help="socket of the plant")
    parser.add_argument("--posture", type=Path, required=True, help="file with the robot's posture")


def _run(context: ProcessContext) -> None:
    folder, arguments = context.state_folder, context.arguments
    with alone(folder, "bridge"):
        cuts, memory = CutFile(folder), open_memory(folder)
        robot = BladesApart(arguments.plant, arguments.posture)
        config, model = load_section(context.config_path, "bridge", BridgeConfig), RobotModel()
        odometer = Odometer(model.drive, config.odometry, TICK_S)
        core = BridgeCore(
            robot, config, model.limits, odometer, "fakes", None, context.transport.rejections, cuts, memory
        )
        gc.freeze()
        try:
            bridge_runner(core, context.transport).run(context.stopping)
        finally:
            robot.close()
            cuts.close()
            memory.close()


if __name__ == "__main__":
    sys.exit(main())
