"""`python -m controller`: the control process."""

import gc
import sys
import uuid
from collections.abc import Sequence

from controller.config import ControllerConfig
from controller.core import Controller
from controller.loop import Loop
from controller.plan_worker import PlanWorker
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.process import ProcessContext, run_process


def main(argv: Sequence[str] | None = None) -> int:
    """Run the controller until it is told to stop. Returns the exit code."""
    return run_process("controller", "Whole-body control and supervision of the robot.", _run, argv=argv)


def _run(context: ProcessContext) -> None:
    config = load_section(context.config_path, "controller", ControllerConfig)
    robot_config = load_section(context.config_path, "robot", RobotConfig)
    controller = Controller(config, robot_config, run_id=uuid.uuid4().hex[:12])
    planner = PlanWorker(config, robot_config)
    loop = Loop(controller, context.transport, config.rate_hz, planner)
    # What lives now lives until the end: the collector need not look at it in the middle of a control period.
    gc.collect()
    gc.freeze()
    try:
        loop.run(context.stopping)
    finally:
        planner.close()


if __name__ == "__main__":
    sys.exit(main())
