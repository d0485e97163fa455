"""Start perception: `python -m perception` or `rolling-panda perception`."""

import argparse
import functools
import sys
from collections.abc import Sequence
from pathlib import Path

from perception.config import PerceptionConfig
from perception.loop import perception_runner
from perception.models.cards import chosen
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda.calibration.file import load, save
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.model.robot import RobotModel
from rolling_panda.runtime.process import ProcessContext, run_process
from rolling_panda.runtime.state_folder import usual_state_folder


def main(argv: Sequence[str] | None = None) -> int:
    """Run until stopped; returns the exit code."""
    return run_process("perception", "Finds pruning points in the camera's frames.", run, argv=argv, check=_check)


def _check(arguments: argparse.Namespace) -> None:
    network_file(load_section(arguments.config, "perception", PerceptionConfig), arguments)
    load_section(arguments.config, "robot", RobotConfig)


def network_file(config: PerceptionConfig, arguments: argparse.Namespace) -> Path | None:
    """The network of the configuration, else the one of `rolling-panda models use`, else None for the shipped one."""
    if config.weights:
        return Path(config.weights)
    model = chosen(arguments.state or usual_state_folder(arguments.robot_id))
    return None if model is None else model.path


def run(context: ProcessContext) -> None:
    """Run until `context.stopping` is set."""
    config = load_section(context.config_path, "perception", PerceptionConfig)
    model = RobotModel(load_section(context.config_path, "robot", RobotConfig))
    segmenter = choose_segmenter(config.segmenter, network_file(config, context.arguments), config.threads)
    folder, robot_id = context.state_folder, context.arguments.robot_id
    mount = load(folder, robot_id, model)
    perception = Perception(config, segmenter, model, mount, functools.partial(save, folder, robot_id))
    perception_runner(context.transport, config, perception).run(context.stopping)


if __name__ == "__main__":
    sys.exit(main())
