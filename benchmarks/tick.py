"""Time of one control step while the robot works on accepted points: everything that runs every period."""

import argparse
import gc
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.kinematic_robot import KinematicRobot
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig

#: Places along the row (m) worked on, one after the other; enough for the steps asked for, again and again.
_SPACING, _COUNT = 0.25, 8


def measure(steps: int) -> list[float]:
    """Durations (s) of `steps` control steps in AUTO, phases of travel, approach, advance, cut and retreat mixed."""
    durations: list[float] = []
    while len(durations) < steps:
        robot = _working()
        gc.collect()
        gc.freeze()
        while len(durations) < steps:
            inputs = robot.inputs()
            started = time.perf_counter()
            out = robot.controller.step(inputs, robot.now)
            ended = time.perf_counter()
            if robot.controller.mode != "AUTO":
                break
            durations.append(ended - started)
            robot.take(out)
        gc.unfreeze()
    return durations


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, and write the figures. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench tick", description=__doc__)
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--steps", type=int, default=5000, help="control steps measured (default: %(default)s)")
    arguments = parser.parse_args(argv)
    if arguments.steps < 1:
        parser.error("--steps must be at least 1")
    micros = np.array(measure(arguments.steps)) * 1e6
    figures = {
        "median_us": round(float(np.median(micros)), 1),
        "p99_us": round(float(np.percentile(micros, 99)), 1),
        "max_us": round(float(micros.max()), 1),
        "steps": len(micros),
    }
    print(
        f"one control step: median {figures['median_us']} us, p99 {figures['p99_us']} us, max {figures['max_us']} us, "
        f"over {figures['steps']} steps"
    )
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return 0


def _working() -> KinematicRobot:
    config = ControllerConfig()
    robot = KinematicRobot(Controller(config, RobotConfig()), config.home)
    robot.step()
    robot.show(
        tuple(
            m.PruningPoint(
                point_id=f"p{i}",
                revision=1,
                position=(i * _SPACING, 0.75, 1.0 + 0.02 * (i % 5)),
                tangent=(0.0, 0.0, 1.0),
                radius=0.004,
                confidence=0.9,
                nodes_seen=5,
                nodes_kept=2,
                vine=0,
                spur=i,
                reason="benchmark",
            )
            for i in range(_COUNT)
        )
    )
    robot.step()
    for intent in (intents.Arm(user="bench"), intents.AcceptAll(user="bench"), intents.Start(user="bench")):
        robot.ask(intent)
    return robot


if __name__ == "__main__":
    sys.exit(main())
