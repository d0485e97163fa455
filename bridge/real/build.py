"""Assembly of the real bridge: opens every device and waits for a state from each before the start."""

import importlib.util
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from bridge.config import BridgeConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.calibration import AS_DRAWN, Calibration, Keep, forget
from bridge.core.cut_orders import CutMemory
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered
from bridge.real.config import CameraConfig, CutterConfig, RealConfig
from bridge.real.cutter import Cutter, CutterStatus
from bridge.real.mp500 import Mp500
from bridge.real.panda import Panda
from bridge.real.realsense import RealSense, open_realsense
from bridge.real.robot import RealRobot
from rolling_panda import reasons
from rolling_panda.bounds import wider
from rolling_panda.calibration.file import Calibrated
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.messages.types import BridgeKind
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import text_of
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.transport.rejections import Rejections
from rolling_panda.transport.zenoh import ForeignWire

_FIRST_STATE_S = 15.0
_LOOPBACK = "127."
_DRIVERS = ("panda_py", "pyrealsense2", "rosbags")


class NoCutter:
    """Cutter of a robot without one: every cut fails with that reason."""

    def __init__(self) -> None:
        """No cut yet."""
        self._status = CutterStatus("open")

    def read(self) -> CutterStatus:
        """How the last cut ended."""
        return self._status

    def enable(self, blades: bool) -> None:
        """Nothing may close."""

    def cut(self, cut_id: str) -> None:
        """Fail."""
        self._status = CutterStatus("open", cut_id, "FAILED_NOT_CUT", reasons.no_cutter())

    def close(self) -> None:
        """Nothing to let go of."""


@dataclass(frozen=True)
class Devices:
    """All opened devices of the robot."""

    base: Mp500
    arm: Panda
    blades: Cutter | NoCutter
    camera: RealSense | None

    def close(self) -> None:
        """Let go of every device."""
        with ExitStack() as stack:
            for device in (self.camera, self.arm, self.base, self.blades):
                if device is not None:
                    stack.callback(device.close)


def open_devices(
    config_path: Path, wire: TransportConfig, model: RobotModel, moving: bool, fakes: bool = False
) -> Devices:
    """Open every configured device.

    Args:
        config_path: TOML file with the sections bridge and real.
        wire: Transport settings of this program.
        model: Of the robot.
        moving: False sends no command to any device.
        fakes: The devices are `bridge.fakes`: the camera's pictures come over the wire.

    Raises:
        ConfigError: A section is wrong.
        InputError: A driver or a device is missing.
        TransportError: The base's or the cutter's wire cannot be reached.
    """
    missing = [name for name in _DRIVERS if importlib.util.find_spec(name) is None]
    if missing:
        names = ", ".join(missing)
        raise InputError(
            f"the real robot's drivers are not installed ({names}); run: pip install 'rolling-panda[real]'"
        )
    real = load_section(config_path, "real", RealConfig)
    config = load_section(config_path, "bridge", BridgeConfig)
    if not real.arm.address:
        raise InputError(f'{config_path} does not say where the arm\'s control box is: [real.arm] address = "…"')
    if fakes and not real.arm.address.startswith(_LOOPBACK):
        raise InputError(
            f"{real.arm.address} may be a real arm: with --fakes [real.arm] address has to begin with {_LOOPBACK}"
        )
    if config.inertial and not real.camera.enabled:
        raise InputError(f"{config_path}: [bridge] inertial = true needs the camera: set [real.camera] enabled = true")
    with ExitStack() as opened:
        camera = _camera(wire, real.camera, config.inertial, fakes) if real.camera.enabled else None
        if camera is not None:
            opened.callback(camera.close)
        base = Mp500(
            ForeignWire(_reached(wire, real.base.connect)), model.drive, config.wheel_acceleration, real.base, moving
        )
        opened.callback(base.close)
        blades = _blades(wire, real.cutter, moving)
        opened.callback(blades.close)
        arm = Panda(real.arm, model.limits, moving)
        opened.pop_all()
    return Devices(base, arm, blades, camera)


def real_bridge(
    config_path: Path,
    wire: TransportConfig,
    moving: bool = True,
    rejections: Rejections | None = None,
    cuts: CutMemory | None = None,
    memory: KeptValue[Remembered] | None = None,
    fakes: bool = False,
    calibrated: Calibrated = AS_DRAWN,
    keep: Keep = forget,
) -> BridgeCore:
    """Assemble a bridge with the real robot.

    Args:
        config_path: TOML file with the sections robot, bridge and real.
        wire: Transport settings of this program.
        moving: False reads only.
        rejections: Table to count refusals in, shared with the transport.
        cuts: Durable memory of cuts; None keeps them for the life of the process.
        memory: Other state that survives a restart; None keeps nothing.
        fakes: Whether the devices are `bridge.fakes`; the bridge reports it.
        calibrated: Calibrations of an earlier start.
        keep: Keeps a new one.

    Raises:
        ConfigError: A section is wrong.
        InputError: A driver or a device is missing, or reports no state.
        TransportError: The base's or the cutter's wire cannot be reached.
    """
    config = load_section(config_path, "bridge", BridgeConfig)
    limits = load_section(config_path, "robot", RobotConfig)
    told = (
        *wider("bridge", config),
        *wider("robot", limits),
        *wider("real", load_section(config_path, "real", RealConfig)),
    )
    model = RobotModel(limits)
    devices = open_devices(config_path, wire, model, moving, fakes)
    try:
        wait_for_states(devices)
    except InputError:
        devices.close()
        raise
    robot = RealRobot(devices.base, devices.arm, devices.blades, devices.camera, moving)
    orientation = BaseOrientation(RobotModel(limits)) if config.inertial else None
    odometer = Odometer(model.drive, config.odometry, TICK_S, 0, orientation)
    kind: BridgeKind = "fakes" if fakes else "real"
    calibration = Calibration(model.drive.sizes, float(model.limits.velocity[0]), calibrated, keep)
    return BridgeCore(
        robot, config, model.limits, odometer, kind, None, rejections, cuts, memory, told, calibration=calibration
    )


def wait_for_states(devices: Devices, limit_s: float = _FIRST_STATE_S) -> None:
    """Wait for the first state of base and arm. Before it their position is unknown, not zero.

    Raises:
        InputError: One of them sent none within the time limit.
    """
    end = time.monotonic() + limit_s
    while not (devices.base.told and devices.arm.told):
        if time.monotonic() > end:
            fault = devices.arm.read().fault if devices.base.told else devices.base.read().fault
            why = "" if fault is None else f": {text_of(fault)}"
            raise InputError(f"no state within {limit_s:.0f} s{why}. See: rolling-panda bridge real --check")
        time.sleep(0.02)


def _reached(wire: TransportConfig, connect: str) -> TransportConfig:
    """The program's own router, or another one that asks for no certificates."""
    return replace(wire, connect=(connect,), certificates="", plain_wire=False) if connect else wire


def _camera(wire: TransportConfig, config: CameraConfig, inertial: bool, fakes: bool) -> RealSense:
    if not fakes:
        return open_realsense(config, inertial)
    # Imported here: without fakes none of their code is loaded.
    from bridge.real.software_realsense import open_fake_realsense

    return open_fake_realsense(ForeignWire(wire), config.rate_hz, inertial)


def _blades(wire: TransportConfig, config: CutterConfig, moving: bool) -> Cutter | NoCutter:
    return Cutter(ForeignWire(_reached(wire, config.connect)), config, moving) if config.service else NoCutter()
