"""The simulated bridge from a configuration file and a seed."""

from pathlib import Path
from typing import Literal

from bridge.config import BridgeConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.cut_memory import CutMemory
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Memory
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.render_process import InlinePhotographer, Photographer, ProcessPhotographer
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.robot.trace import TraceWriter
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from rolling_panda import topics
from rolling_panda.bounds import wider
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.supervision import HardwareStop
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.zenoh import Onlooker, Rejections


def simulated_bridge(
    config_path: Path,
    seed: int,
    trace: Path | None = None,
    camera: Literal["inline", "process"] = "inline",
    rejections: Rejections | None = None,
    cuts: CutMemory | None = None,
    memory: Memory | None = None,
) -> BridgeCore:
    """A bridge with the simulated robot beside a row grown from `seed`.

    Args:
        config_path: TOML file with the sections robot, bridge, vineyard and camera.
        seed: Of the row and of the camera's noise.
        trace: File to record every physics step in.
        camera: `inline` renders within a step, so that the same seed and commands give the same messages; `process`
            renders beside it, so that the physics keeps time.
        rejections: Table to count refusals in, shared with the transport.
        cuts: Remembers cuts through restarts; None for as long as this lives.
        memory: What survives a restart; None forgets.

    Raises:
        ConfigError: A section is wrong, or the trace cannot be written.
    """
    config = load_section(config_path, "bridge", BridgeConfig)
    limits = load_section(config_path, "robot", RobotConfig)
    model = RobotModel(limits)
    odometer = Odometer(model.drive, config.odometry, TICK_S, seed)
    robot = simulated_robot(config_path, seed, trace, camera)
    told = (*wider("bridge", config), *wider("robot", limits))
    return BridgeCore(robot, config, model.limits, odometer, "sim", robot.scenery, rejections, cuts, memory, told)


def simulated_robot(
    config_path: Path, seed: int, trace: Path | None, camera: Literal["inline", "process", "device"]
) -> SimulatedRobot:
    """The simulated robot beside a row grown from `seed`; arguments as of `simulated_bridge`.

    The camera as a `device` renders in a process too, which does not step back: a camera exposes however busy the
    computer is.

    Raises:
        ConfigError: A section is wrong, or the trace cannot be written.
    """
    config = load_section(config_path, "bridge", BridgeConfig)
    row = grow(load_section(config_path, "vineyard", VineyardConfig), seed)
    lens = load_section(config_path, "camera", CameraConfig)
    writer = None if trace is None else TraceWriter(trace)
    photographer: Photographer = (
        InlinePhotographer(lens, seed)
        if camera == "inline"
        else ProcessPhotographer(lens, seed, "interface" if camera == "device" else "background")
    )
    return SimulatedRobot(config, row, photographer, writer)


def subscribe_button(core: BridgeCore, transport: Onlooker) -> None:
    """Let the wire press the emergency stop button that the simulated robot would have."""
    robot = core.robot

    def press(message: HardwareStop, at: float) -> None:
        if isinstance(robot, SimulatedRobot):
            robot.emergency = message.pressed

    transport.subscribe(topics.HARDWARE_STOP, press)
