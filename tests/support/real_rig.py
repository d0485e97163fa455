"""The real bridge on devices that are fakes in processes of their own, which the makers' client libraries talk to."""

import os
import time
from contextlib import ExitStack

import numpy as np

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.attitude import GRAVITY, BaseOrientation, Inertial
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.picture import Picture
from bridge.real.config import ArmConfig, BaseConfig, CutterConfig
from bridge.real.cutter import Cutter
from bridge.real.mp500 import Mp500
from bridge.real.panda import Panda
from bridge.real.robot import RealRobot
from bridge.real.software_realsense import SoftwareMotion
from rolling_panda.config import TransportConfig
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.zenoh import ForeignWire
from tests.support.bridge_rig import MODEL, PICTURE
from tests.support.processes.device_process import DeviceProcess
from tests.support.processes.local_router import local_router

ADDRESS = f"127.0.{os.getpid() % 250 + 1}.8"
SERVICE = "cutter/close"
#: Time between two samples of the inertial sensors (s).
_SAMPLE_S = 0.005


class OnePicture:
    """A camera whose pictures nobody looks at, upright and at rest by its inertial sensors."""

    def __init__(self) -> None:
        self._ready: Picture | None = None
        self._motion = SoftwareMotion()
        self._felt_at = 0.0

    def inertial(self) -> Inertial | None:
        if (now := time.monotonic()) - self._felt_at > _SAMPLE_S:
            self._felt_at = now
            self._motion.feel(Inertial(now, np.zeros(3), np.array([0.0, -GRAVITY, 0.0])))
        return self._motion.newest()

    def capture(self, expose: bool) -> Picture | None:
        ready, self._ready = self._ready, PICTURE if expose else None
        return ready

    def close(self) -> None:
        self._motion.close()


class Devices:
    """Router, base with cutter, and arm, each in a process of its own but the router."""

    def __init__(self, address: str = ADDRESS) -> None:
        self._begun = ExitStack()
        self.endpoint = self._begun.enter_context(local_router())
        self.base = DeviceProcess("base", "--plain-wire", "--connect", self.endpoint, wait=False)
        self.arm = DeviceProcess("arm", "--arm", address)
        self.base.wait_until_ready()

    def breaches(self) -> list[str]:
        return [*self.base.tell()["breaches"], *self.arm.tell()["breaches"]]

    def close(self) -> None:
        self.base.close()
        self.arm.close()
        self._begun.close()


class RealPlant(Devices):
    """Base, arm and blades; what they have been made to do is read from themselves."""

    robot: RealRobot | None = None

    def start(self) -> BridgeCore:
        """A bridge on these devices, once they are there; the one before lets go."""
        if self.robot is not None:
            self.robot.close()
        config = BridgeConfig(inertial=True)
        acceleration = config.wheel_acceleration
        wire = TransportConfig(connect=(self.endpoint,), plain_wire=True)
        base = Mp500(ForeignWire(wire), MODEL.drive, acceleration, BaseConfig())
        arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), MODEL.limits)
        blades = Cutter(ForeignWire(wire), CutterConfig(service=SERVICE))
        self.robot = RealRobot(base, arm, blades, OnePicture())
        end = time.monotonic() + 15.0
        while self.robot.read().fault or blades.read().state != "open":
            assert time.monotonic() < end, self.robot.read().fault
            time.sleep(0.02)
        odometer = Odometer(MODEL.drive, OdometryConfig(), TICK_S, 0, BaseOrientation(RobotModel()))
        return BridgeCore(self.robot, config, MODEL.limits, odometer, "real")

    def velocity(self) -> Array:
        return np.array([*self.base.tell()["wheels"], *self.arm.tell()["dq"]])

    def push(self, torques: tuple[float, ...]) -> None:
        self.arm.tell("push " + " ".join(map(str, torques)))

    def bites(self) -> int:
        return int(self.base.tell_all("report")["cutter"]["bites"])
