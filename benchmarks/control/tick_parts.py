"""Time of the parts of one whole-body step, on demands recorded in automatic work, with everything switched on."""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.peers.stopwatch import histogram
from controller.config import ControllerConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.registry import guards
from controller.whole_body.task import IkProblem, Method, Solution
from controller.whole_body.velocity_bounds import VelocityBounds
from rolling_panda.model.robot import RobotModel

#: Along 6 m of row, a little behind the points that are worked on, so that the robot comes near but is never held.
_SPAN, _ROW_Y = (-2.0, 4.0), 0.87


@dataclass(frozen=True)
class Times:
    """Of one part over all demands (µs), and how many of them are in each bin of `stopwatch.EDGES_US`."""

    median_us: float
    p99_us: float
    max_us: float
    histogram: dict[str, int]

    @staticmethod
    def of(seconds: Sequence[float]) -> "Times":
        """Summary of durations (s)."""
        micros = np.array(seconds) * 1e6
        median, p99, most = (round(float(x), 1) for x in (np.median(micros), np.percentile(micros, 99), micros.max()))
        return Times(median, p99, most, histogram(micros))


class Recorder:
    """A method that keeps what another is asked for, but for what is the arm's alone between the base's periods."""

    def __init__(self, method: Method) -> None:
        """Stand before `method`."""
        self.name, self.flows, self._method = method.name, method.flows, method
        self.demands: list[IkProblem] = []

    def solve(self, problem: IkProblem) -> Solution:
        """Keep the problem, and answer it."""
        if problem.held is None:
            self.demands.append(problem)
        return self._method.solve(problem)


def obstacles() -> list[Obstacle]:
    """The row as the collision model gets it: 4 posts, 4 wires, 6 pieces of cordon, 46 canes that stay."""
    low, high = _SPAN
    rods = [Obstacle(f"wire{z}", "wire", (low, _ROW_Y, z), (high, _ROW_Y, z), 0.002) for z in (0.6, 1.2, 1.5, 1.8)]
    for i in range(4):
        x = low + 2.0 * i
        rods.append(Obstacle(f"post{i}", "post", (x, _ROW_Y, 0.0), (x, _ROW_Y, 1.9), 0.04))
    for i in range(6):
        x = low + i
        rods.append(Obstacle(f"cordon{i}", "cordon", (x, _ROW_Y, 0.9), (x + 1.0, _ROW_Y, 0.9), 0.02))
    for i in range(46):
        x = low + 6.0 * (i + 0.5) / 46
        rods.append(Obstacle(f"cane {i}", "cane", (x, _ROW_Y, 0.9), (x + 0.05, _ROW_Y + 0.05, 1.5), 0.004))
    return rods


def measure_parts(demands: Sequence[IkProblem]) -> dict[str, Times]:
    """Time of each part, of the whole step with and without guards, and of the method `nullspace`.

    The parts are timed one by one; `tool and null space` is what is left of the step.
    """
    config = ControllerConfig()
    dt, robot = 1.0 / config.rate_hz, RobotModel()
    collision = CollisionModel(robot)
    collision.set_obstacles(obstacles())
    rows = guards(robot, config.whole_body, dt, collision)
    full, bare, nullspace = (
        Hierarchy(robot, config.whole_body, dt, rows),
        Hierarchy(robot, config.whole_body, dt),
        Nullspace(robot, config.whole_body, dt),
    )
    manipulability, box = ArmManipulability(), VelocityBounds(robot, config.whole_body, dt)
    parts: dict[str, Callable[[IkProblem], object]] = {
        "kinematics": lambda d: robot.kinematics(d.q),
        "manipulability and gradient": lambda d: manipulability.at(d.kinematics.J),
        "bounds": lambda d: box.at(d.q, d.sent, d.sent_before),
        **{guard.name: guard.rows for guard in rows},
    }
    times: dict[str, list[float]] = {name: [] for name in (*parts, "step", "step without guards", "nullspace step")}
    whole: dict[str, Method] = {"step": full, "step without guards": bare, "nullspace step": nullspace}
    clock = time.perf_counter
    gc.collect()
    gc.freeze()
    gc.disable()
    for problem in demands:
        for name, part in parts.items():
            begin = clock()
            part(problem)
            times[name].append(clock() - begin)
        for name, method in whole.items():
            begin = clock()
            robot.kinematics(problem.q)
            method.solve(problem)
            times[name].append(clock() - begin)
    gc.enable()
    gc.unfreeze()
    rest = np.array(times["step"]) - sum(np.array(times[name]) for name in parts)
    return {name: Times.of(seconds) for name, seconds in (*times.items(), ("tool and null space", rest.tolist()))}
