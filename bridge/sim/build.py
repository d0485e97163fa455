"""The simulated bridge from a configuration file and a seed."""

from pathlib import Path
from typing import Literal

from bridge.config import BridgeConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.calibration import AS_DRAWN, Calibration, Keep, forget
from bridge.core.cut_orders import CutMemory
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.render_process import CameraRenderer, RenderProcess
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.robot.trace import TraceWriter
from bridge.sim.vineyard.config import load_vineyard
from bridge.sim.vineyard.grow import grow
from bridge.sim.world.config import load_world
from bridge.sim.world.growth import overgrown
from rolling_panda.bounds import wider
from rolling_panda.calibration.file import Calibrated
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.model.robot import RobotModel
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.transport.rejections import Rejections


def simulated_bridge(
    config_path: Path,
    seed: int,
    trace: Path | None = None,
    camera: Literal["inline", "process"] = "inline",
    rejections: Rejections | None = None,
    cuts: CutMemory | None = None,
    memory: KeptValue[Remembered] | None = None,
    calibrated: Calibrated = AS_DRAWN,
    keep: Keep = forget,
) -> BridgeCore:
    """Bridge core with the simulated robot beside a row grown from `seed`.

    Args:
        config_path: TOML file with the sections robot, bridge, vineyard, camera and world.
        seed: Of row, camera and disturbances.
        trace: File for a trace of every physics step.
        camera: `inline` renders within a step, for reproducible messages; `process` renders in a process, for real
            time.
        rejections: Counters of refusals, shared with the transport.
        cuts: Cuts that survive a restart; None for this run only.
        memory: State that survives a restart; None for none.
        calibrated: Calibrations of an earlier start.
        keep: Keeps a new one.

    Raises:
        ConfigError: A section is wrong, or the trace cannot be written.
    """
    config = load_section(config_path, "bridge", BridgeConfig)
    limits = load_section(config_path, "robot", RobotConfig)
    model = RobotModel(limits)
    orientation = BaseOrientation(RobotModel(limits)) if config.inertial else None
    odometer = Odometer(model.drive, config.odometry, TICK_S, seed, orientation)
    robot = simulated_robot(config_path, seed, trace, camera)
    widened = (*wider("bridge", config), *wider("robot", limits))
    calibration = Calibration(model.drive.sizes, float(model.limits.velocity[0]), calibrated, keep)
    return BridgeCore(
        robot,
        config,
        model.limits,
        odometer,
        "sim",
        robot.scenery,
        rejections,
        cuts,
        memory,
        widened,
        calibration=calibration,
        scenery_motion=robot.scenery_motion,
    )


def simulated_robot(
    config_path: Path, seed: int, trace: Path | None, camera: Literal["inline", "process", "device"]
) -> SimulatedRobot:
    """The simulated robot beside a row grown from `seed`; arguments as of `simulated_bridge`.

    A camera of kind `device` renders in a process with normal priority, as a real camera does not depend on the load.

    Raises:
        ConfigError: A section is wrong, or the trace cannot be written.
    """
    config = load_section(config_path, "bridge", BridgeConfig)
    world = load_world(config_path)
    vineyard = load_vineyard(config_path)
    row = overgrown(grow(vineyard, seed), world, seed, vineyard.laterals)
    lens = load_section(config_path, "camera", CameraConfig)
    writer = None if trace is None else TraceWriter(trace)
    renderer: CameraRenderer
    if camera == "inline":
        # Imported here for the same reason as in the process.
        from bridge.sim.camera.renderer import InlineRenderer

        renderer = InlineRenderer(lens, seed, world)
    else:
        renderer = RenderProcess(lens, seed, "perception" if camera == "device" else "background", world)
    return SimulatedRobot(config, row, renderer, writer, world, seed)


def press_button(core: BridgeCore, pressed: bool) -> None:
    """Press or release the emergency stop button of a simulated robot."""
    if isinstance(core.robot, SimulatedRobot):
        core.robot.emergency = pressed
