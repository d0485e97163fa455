"""The real bridge on devices that are fakes in processes of their own, which the makers' client libraries talk to."""

import os
import threading
import time
from contextlib import ExitStack

import numpy as np
import pinocchio as pin
import pyrealsense2 as rs

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.attitude import GRAVITY, BaseOrientation, Inertial
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.picture import Picture
from bridge.real.config import ArmConfig, BaseConfig, CutterConfig
from bridge.real.cutter import Cutter
from bridge.real.mp500 import Mp500
from bridge.real.panda import Panda
from bridge.real.realsense import RealSense
from bridge.real.robot import RealRobot
from bridge.real.software_realsense import SoftwareDevice, SoftwareMotion
from rolling_panda.config import TransportConfig
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.transport.zenoh import ForeignWire
from tests.support.bridge_rig import MODEL, NUMBER_M, PICTURE, number_of
from tests.support.processes.device_process import DeviceProcess
from tests.support.processes.local_router import local_router

ADDRESS = f"127.0.{os.getpid() % 250 + 1}.8"
SERVICE = "cutter/close"
CONFIG = BridgeConfig(inertial=True)
#: The longest start of the devices on a busy machine (s).
_STARTUP_S = 60.0
#: Time between two samples of the inertial sensors (s); pictures a second, and their lens.
_SAMPLE_S, _RATE_HZ = 0.005, 30
_LENS = Intrinsics(32, 24, 20.0, 20.0, 16.0, 12.0)


class FakeCamera:
    """The camera's driver on librealsense's software device, which streams pictures and inertial samples.

    Once it streams its pictures show their number, and it feels how arm and base turn it. The base may turn by less
    than its wheels tell, since it slides. Before, it has one picture for all, is upright and at rest, and costs little.
    """

    def __init__(self, base: Mp500, arm: Panda, late_s: float, slides: float) -> None:
        """Do not stream yet.

        Args:
            base: Which the camera rides on.
            arm: Which holds it.
            late_s: By how much pictures are exposed later than their times tell (s).
            slides: Share of the base's turn by its wheels that it does not make.
        """
        self._base, self._arm, self._late_s, self._turns = base, arm, late_s, 1.0 - slides
        self._model = RobotModel()
        self._device, self._motion = SoftwareDevice(_LENS, _RATE_HZ, NUMBER_M), SoftwareMotion()
        self._driver: RealSense | None = None
        #: When each was exposed (s, monotonic), number 1 first.
        self.exposures: list[float] = []
        #: By how much the base has turned (rad).
        self.heading = 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fake camera")
        self._ready: Picture | None = None
        self._felt_at = 0.0

    def stream(self) -> None:
        """Stream from now on; base and arm have to tell where they are."""
        self._driver = RealSense(self._device, rs.align(rs.stream.color), self._motion)
        self._thread.start()

    def inertial(self) -> Inertial | None:
        if self._driver is not None:
            return self._driver.inertial()
        if (now := time.monotonic()) - self._felt_at > _SAMPLE_S:
            self._felt_at = now
            self._motion.feel(Inertial(now, np.zeros(3), np.array([0.0, -GRAVITY, 0.0])))
        return self._motion.newest()

    def capture(self, expose: bool) -> Picture | None:
        if self._driver is not None:
            return self._driver.capture(expose)
        ready, self._ready = self._ready, PICTURE if expose else None
        return ready

    def close(self) -> None:
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._driver is None:
            self._motion.close()
        else:
            self._driver.close()

    def _run(self) -> None:
        last, before = time.monotonic(), self._rotation()
        show = last
        while not self._closing.wait(_SAMPLE_S):
            now = time.monotonic()
            turning = MODEL.drive.twist(*self._base.read().velocity.tolist())[1]
            self.heading += self._turns * turning * (now - last)
            R = self._rotation()
            rate = pin.log3(before.T @ R) / (now - last)
            self._motion.feel(Inertial(now, rate, R.T @ [0.0, 0.0, GRAVITY]))
            last, before = now, R
            if now >= show:
                show = now + 1.0 / _RATE_HZ
                self._show()

    def _rotation(self) -> Array:
        """R_odom_camera (3×3)."""
        q = np.zeros(3 + NXI)
        q[2], q[ARM_Q] = self.heading, self._arm.read().position
        return np.array(self._model.pose(q, self._model.camera_id).rotation)

    def _show(self) -> None:
        self.exposures.append(time.monotonic())
        wall = np.full((_LENS.height, _LENS.width), len(self.exposures), np.uint16)
        self._device.show(wall, np.zeros((*wall.shape, 3), np.uint8), time.time() - self._late_s)


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

    def __init__(self, config: BridgeConfig = CONFIG, late_s: float = 0.0, slides: float = 0.0) -> None:
        """Start the devices; `late_s` and `slides` as of `FakeCamera`."""
        super().__init__()
        self._config, self._late_s, self._slides = config, late_s, slides

    def start(self) -> BridgeCore:
        """A bridge on these devices, once they are there; the one before lets go."""
        if self.robot is not None:
            self.robot.close()
        config = self._config
        acceleration = config.wheel_acceleration
        wire = TransportConfig(connect=(self.endpoint,), plain_wire=True)
        base = Mp500(ForeignWire(wire), MODEL.drive, acceleration, BaseConfig())
        arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), MODEL.limits)
        blades = Cutter(ForeignWire(wire), CutterConfig(service=SERVICE))
        self.camera = FakeCamera(base, arm, self._late_s, self._slides)
        self.robot = RealRobot(base, arm, blades, self.camera)
        end = time.monotonic() + _STARTUP_S
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

    def stream(self) -> None:
        self.camera.stream()

    def heading(self) -> float:
        return self.camera.heading

    def exposed_at(self, frame: CameraFrame) -> float:
        return self.camera.exposures[number_of(frame) - 1]
