"""`python -m controller`: the control process."""

import argparse
import sys
import uuid
from collections.abc import Sequence

from controller.config import ControllerConfig
from controller.core import Controller
from controller.ledger.start import restored, start_record
from controller.ledger.store import Ledger
from controller.ledger.writer import LedgerWriter
from controller.loop import controller_runner, open_stop_file
from controller.planner_process import PlannerProcess
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.runtime.process import ProcessContext, run_process
from rolling_panda.runtime.scheduling import freeze_heap, release_library
from rolling_panda.runtime.state_folder import alone


def main(argv: Sequence[str] | None = None) -> int:
    """Run the controller until it is told to stop. Returns the exit code."""
    return run_process("controller", "Whole-body control and supervision of the robot.", _run, argv=argv, check=_check)


def _check(arguments: argparse.Namespace) -> None:
    load_section(arguments.config, "controller", ControllerConfig)
    load_section(arguments.config, "robot", RobotConfig)


def _run(context: ProcessContext) -> None:
    with alone(context.state_folder, "controller"):
        _work(context)


def _work(context: ProcessContext) -> None:
    config = load_section(context.config_path, "controller", ControllerConfig)
    robot_config = load_section(context.config_path, "robot", RobotConfig)
    run_id = uuid.uuid4().hex[:12]
    folder = context.state_folder
    controller = Controller(config, robot_config, run_id)
    stop_file = open_stop_file(folder)
    before = restored(folder)
    controller.restore(
        before.tickets, stop_file.value, before.order, before.preview, before.approaches, before.postures
    )
    ledger = LedgerWriter(lambda: Ledger(folder))
    ledger.write([start_record(context.config_path, run_id)])
    planner = PlannerProcess(config, robot_config)
    runner = controller_runner(controller, context.transport, config.rate_hz, ledger, planner, stop_file)
    freeze_heap()
    # The compiled functions are loaded; the compiler is not used again.
    release_library("libllvmlite")
    try:
        runner.run(context.stopping)
    finally:
        planner.close()
        ledger.close()
        stop_file.close()


if __name__ == "__main__":
    sys.exit(main())
