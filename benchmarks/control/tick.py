"""Time of one control step while the robot works on accepted points: everything that runs every period."""

import gc
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.common.documents import bench_parser, write
from benchmarks.control.tick_parts import Recorder, Times, measure_parts, obstacles
from benchmarks.peers.run import run_peers
from controller.config import ControllerConfig
from controller.core import Controller
from controller.whole_body.collision import CollisionModel
from controller.whole_body.registry import make_method
from controller.whole_body.task import IkProblem, Method
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from rolling_panda.model.robot import RobotModel
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

#: Places along the row (m) worked on, one after the other; enough for the steps asked for, again and again.
_SPACING, _COUNT = 0.25, 8


def measure(steps: int) -> tuple[list[float], list[IkProblem]]:
    """Durations (s) of `steps` control steps in AUTO, phases of travel, approach, advance, cut and retreat mixed.

    Returns:
        The durations, and what the whole-body method was asked for in a run that was not timed.
    """
    durations: list[float] = []
    while len(durations) < steps:
        robot = working()
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
    return durations, recorded(steps)


def recorded(steps: int) -> list[IkProblem]:
    """What the whole-body method is asked for in automatic work beside a row of obstacles."""
    config, robot_model = ControllerConfig(), RobotModel()
    collision = CollisionModel(robot_model)
    collision.set_obstacles(obstacles())
    recorder = Recorder(make_method(robot_model, config.whole_body, 1.0 / config.rate_hz, collision))
    demands: list[IkProblem] = []
    while len(demands) < steps:
        recorder.demands.clear()
        robot = working(recorder)
        while len(demands) + len(recorder.demands) < steps and (robot.now < 1.0 or robot.controller.mode == "AUTO"):
            robot.step()
        demands += recorder.demands
    return demands[:steps]


def main(argv: Sequence[str]) -> int:
    """Measure, print, and write the figures. Returns the exit code."""
    parser = bench_parser("tick", __doc__)
    parser.add_argument("--steps", type=int, default=5000, help="control steps measured (default: %(default)s)")
    parser.add_argument("--peers", action="store_true", help="also Pink, mink, PlaCo and TSID on the same problems")
    parser.add_argument(
        "--environments",
        type=Path,
        metavar="DIR",
        help="virtual environments of the peers: DIR/placo, DIR/tsid (default: this one)",
    )
    arguments = parser.parse_args(argv)
    if arguments.steps < 1:
        parser.error("--steps must be at least 1")
    durations, demands = measure(arguments.steps)
    whole, parts = Times.of(durations), measure_parts(demands)
    figures: dict[str, Any] = {**asdict(whole), "steps": len(durations)}
    figures["parts"] = {name: asdict(times) for name, times in parts.items()}
    print(
        f"one control step: median {whole.median_us} us, p99 {whole.p99_us} us, max {whole.max_us} us, "
        f"over {len(durations)} steps"
    )
    print(f"\n{'one whole-body step, by part':<30}{'median':>9}{'p99':>9}{'max us':>9}")
    for name, times in parts.items():
        print(f"{name:<30}{times.median_us:>9}{times.p99_us:>9}{times.max_us:>9}")
    if arguments.peers:
        figures["peers"] = run_peers(demands, ControllerConfig(), arguments.environments)
        print(f"\n{'peers on the same problems':<30}{'median':>9}{'p99':>9}{'max us':>9}")
        for peer in figures["peers"]:
            print(_line(peer))
    write(arguments.json, figures)
    return 0


def _line(peer: dict[str, Any]) -> str:
    if "absent" in peer:
        return f"{peer['name']:<30}absent: {peer['absent']}"
    title = f"{peer['name']} {peer['version']}"
    failed = f"  without an answer: {peer['failed']}" if peer["failed"] else ""
    return f"{title:<30}{peer['median_us']:>9}{peer['p99_us']:>9}{peer['max_us']:>9}  {peer['note']}{failed}"


def working(method: Method | None = None) -> KinematicRobot:
    """A robot without mass that has begun to work on accepted points."""
    config = ControllerConfig()
    robot = KinematicRobot(Controller(config, RobotConfig(), method=method), config.work.home)
    robot.step()
    robot.show(tuple(point(f"p{i}", (i * _SPACING, 0.75, 1.0 + 0.02 * (i % 5)), spur=i) for i in range(_COUNT)))
    robot.step()
    for intent in (
        intents.Arm(user="bench"),
        intents.AcceptAll(user="bench", confidence=0.0),
        intents.Start(user="bench"),
    ):
        robot.ask(intent)
    return robot
