"""`rolling-panda bridge`: the bridge process between the wire and a robot."""

import argparse
import functools
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bridge.config import BridgeConfig
from bridge.core.bridge import BridgeCore
from bridge.core.cut_orders import CutFile
from bridge.core.state_memory import Remembered, begin_anew, open_memory
from bridge.loop import bridge_runner
from bridge.real.config import RealConfig
from bridge.sim.camera.config import CameraConfig
from bridge.sim.vineyard.config import load_vineyard
from bridge.sim.world.config import load_world
from rolling_panda.calibration.file import load_robot, save_robot
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.errors import RollingPandaError
from rolling_panda.messages.robot import AnyCalibration
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.runtime.process import ProcessContext, add_common_arguments, run_process, state_folder
from rolling_panda.runtime.scheduling import freeze_heap
from rolling_panda.runtime.state_folder import alone


def main(argv: Sequence[str] | None = None) -> int:
    """Run the bridge; returns the exit code."""
    about = "The robot, with its own watchdog, limits and latched stop."
    words = with_usual_config(sys.argv[1:] if argv is None else argv)
    if "--begin-anew" in words:
        return _begin_anew(words)
    return run_process("bridge", about, _run, _arguments, words, _check)


def with_usual_config(argv: Sequence[str]) -> list[str]:
    """The command line; for the real robot with its own configuration where none is given."""
    given = any(word == "--config" or word.startswith("--config=") for word in argv)
    own = "assets/config/fakes.toml" if "--fakes" in argv else "assets/config/real.toml"
    usual = ["--config", str(resource(own))] if "real" in argv and not given else []
    return [*argv, *usual]


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("kind", nargs="?", choices=("sim", "real"), default="sim", help="robot (default: sim)")
    parser.add_argument("--seed", type=_seed, default=0, help="of the simulated vineyard (default: 0)")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="record what the simulation actuates")
    parser.add_argument(
        "--check", action="store_true", help="real: check every device without moving it; print a table"
    )
    parser.add_argument("--fakes", action="store_true", help="real: use fake devices; the page shows it")
    parser.add_argument("--readonly", action="store_true", help="real: publish the robot's state, command nothing")
    parser.add_argument(
        "--begin-anew", action="store_true", help="set the stored state aside, latch a stop in its place, and end"
    )


def _begin_anew(words: Sequence[str]) -> int:
    """Without the wire, which is not there where the program does not start."""
    parser = argparse.ArgumentParser(prog="rolling-panda bridge")
    add_common_arguments(parser)
    _arguments(parser)
    arguments = parser.parse_args(words)
    try:
        folder = state_folder(arguments)
        with alone(folder, "bridge"):
            done = begin_anew(folder)
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda bridge: {error}", file=sys.stderr)
        return 1
    print(f"{text_of(done)}; a stop is latched, which a supervisor has to reset once the bridge runs")
    return 0


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a seed; give an integer from 0")
    return int(text)


def _check(arguments: argparse.Namespace) -> None:
    load_section(arguments.config, "bridge", BridgeConfig)
    load_section(arguments.config, "robot", RobotConfig)
    if arguments.kind == "real":
        load_section(arguments.config, "real", RealConfig)
    else:
        load_vineyard(arguments.config)
        load_section(arguments.config, "camera", CameraConfig)
        load_world(arguments.config)


def _run(context: ProcessContext) -> None:
    arguments = context.arguments
    if arguments.kind == "real" and arguments.check:
        from bridge.real.commissioning import check

        check(context.config_path, context.wire, arguments.fakes)
        return
    with alone(context.state_folder, "bridge"):
        _work(context)


def _work(context: ProcessContext) -> None:
    cuts, memory = CutFile(context.state_folder), open_memory(context.state_folder)
    try:
        core, press = _core(context, cuts, memory)
        freeze_heap()
        try:
            bridge_runner(core, context.transport, press).run(context.stopping)
        finally:
            core.robot.close()
    finally:
        cuts.close()
        memory.close()


def _core(
    context: ProcessContext, cuts: CutFile, memory: KeptValue[Remembered]
) -> tuple[BridgeCore, Callable[[bool], None]]:
    """The core, and what presses its robot's button."""
    arguments, rejections = context.arguments, context.transport.rejections
    folder, robot_id = context.state_folder, arguments.robot_id
    drawn = RobotModel(load_section(context.config_path, "robot", RobotConfig)).drive.sizes
    calibrated, disk = load_robot(folder, robot_id, drawn), ThreadPoolExecutor(1, "calibration")

    def keep(calibration: AnyCalibration) -> "Future[None]":
        return disk.submit(save_robot, folder, robot_id, calibration)

    # Imported here: the real bridge must not need the simulator, and vice versa.
    if arguments.kind == "real":
        from bridge.real.build import real_bridge

        moving, fakes = not arguments.readonly, arguments.fakes
        core = real_bridge(context.config_path, context.wire, moving, rejections, cuts, memory, fakes, calibrated, keep)
        return core, lambda pressed: None
    from bridge.sim.build import press_button, simulated_bridge

    seed, trace = arguments.seed, arguments.trace
    core = simulated_bridge(context.config_path, seed, trace, "process", rejections, cuts, memory, calibrated, keep)
    return core, functools.partial(press_button, core)


if __name__ == "__main__":
    sys.exit(main())
