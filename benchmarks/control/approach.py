"""Ways of the arm from cut to cut among the wood that stays, beside planners of OMPL.

Rows are grown; before each right cut of the truth the base stands and the arm ends as the goal chooser has it. It
begins right before the cut to the left, or in the survey posture where the arm cannot be there. All planners get the
same start, goal and capsules: posts, trunks, cordons, wires and the wood that stays. The judge looks at each way twice
as densely as the planners do.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import share
from benchmarks.control.arm_path import ArmPath, ArmPathPlanner, Blocked
from benchmarks.control.goal_planner import GoalChooser
from benchmarks.control.plan import arm_samples
from benchmarks.control.plan_limits import PlanLimits, plan_limits
from benchmarks.control.reach_run import BASE
from benchmarks.control.reach_targets import HOME
from benchmarks.peers.sampling import OMPL, OmplPlanner
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import RightCut, judge, staying_rods
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import vector3

#: How far before the cuts a way begins and ends (m), and the clearance that is kept (m).
_BEFORE, _CLEARANCE = 0.04, 0.005
#: Largest joint step between two looks of the judge (rad).
_LOOK = 0.01
#: Planners: ours, and those of OMPL.
PLANNERS = ("ours", *OMPL)
#: What is in the way and is not pruned.
_FIXED = ("post", "trunk", "cordon", "wire", "spur")


@dataclass(frozen=True)
class Task:
    """A start (12) and a goal of the arm (7) among obstacles."""

    seed: int
    q: Array
    goal: Array
    obstacles: tuple[Obstacle, ...]


@dataclass(frozen=True)
class Way:
    """What a planner gave for a task.

    Attributes:
        seed: Of the row.
        found: Whether it found a way.
        planned_s: Processor time (s).
        duration: Of the motion at the arm's rates, at rest at each corner (s).
        length: Sum of the largest joint's steps (rad).
        clearance: Least distance on the way (m).
        corners: Postures between start and goal.
    """

    seed: int
    found: bool
    planned_s: float
    duration: float = 0.0
    length: float = 0.0
    clearance: float = 0.0
    corners: int = 0


def tasks(seed: int, limits: PlanLimits) -> list[Task]:
    """One task before each right cut of a grown row that the arm can be held before."""
    row = grow(VineyardConfig(vines=1), seed)
    staying = staying_rods(row)
    obstacles = tuple(
        Obstacle(
            f"{rod.kind} {number}",
            rod.kind,
            vector3(rod.start),
            vector3(rod.end),
            max(rod.start_radius, rod.end_radius),
        )
        for number, rod in row.standing()
        if rod.kind in _FIXED or number in staying
    )
    robot = RobotModel()
    collision = CollisionModel(robot)
    collision.set_obstacles(obstacles)
    chooser, found, before = GoalChooser(robot, collision, limits, seed), [], None
    for cut in sorted((spur.cut for spur in judge(row) if spur.cut is not None), key=lambda cut: float(cut.best[0])):
        start = np.zeros(12)
        start[0], start[ARM_Q] = float(cut.best[0]), HOME
        stands = chooser.find(start, _before(cut), free_axis=True).stands
        if stands:
            q = stands[0].q.copy()
            q[ARM_Q] = HOME
            at = () if before is None else chooser.find(q, _before(before), free_axis=True, base_fixed=True).stands
            if at:
                q = at[0].q.copy()
            if collision.least(q).distance >= limits.clearance:
                found.append(Task(seed, q, stands[0].q[ARM_Q], obstacles))
        before = cut
    return found


def _before(cut: RightCut) -> Any:
    """The tool before a cut (pin.SE3): its y along the wood, its z across the row."""
    y = cut.tangent
    z = np.array([0.0, 1.0, 0.0])
    z -= (z @ y) * y
    z /= np.linalg.norm(z)
    return pin.SE3(np.column_stack([np.cross(y, z), y, z]), cut.best - _BEFORE * z)


def way(task: Task, planner: str, limits: PlanLimits, seconds: float) -> Way:
    """Plan one task and judge the way."""
    robot = RobotModel()
    collision = CollisionModel(robot)
    collision.set_obstacles(task.obstacles)
    find: Callable[[Array, Array], ArmPath | Blocked | None] = (
        ArmPathPlanner(collision, limits, task.seed).find
        if planner == "ours"
        else OmplPlanner(planner, collision, limits, seconds, task.seed).find
    )
    began = time.thread_time()
    path = find(task.q, task.goal)
    planned_s = time.thread_time() - began
    if not isinstance(path, ArmPath):
        return Way(task.seed, False, planned_s)
    steps = np.abs(np.diff(path.postures, axis=0)).max(axis=1)
    duration = limits.dt * (len(arm_samples(path, limits)) - 1)
    clearance = _least(collision, task.q, path)
    return Way(task.seed, True, planned_s, duration, float(steps.sum()), clearance, len(path.postures) - 2)


def _least(collision: CollisionModel, q: Array, path: ArmPath) -> float:
    least, place = np.inf, q.copy()
    for a, b in zip(path.postures, path.postures[1:], strict=False):
        for part in np.linspace(0.0, 1.0, int(np.abs(b - a).max() / _LOOK) + 2):
            place[ARM_Q] = a + part * (b - a)
            least = min(least, collision.least(place).distance)
    return float(least)


def summarise(ways: Sequence[Way]) -> dict[str, Any]:
    """Shares and figures of one planner."""
    found = [each for each in ways if each.found]
    among = share(len(found), len(ways))
    planned = 1e3 * np.array([each.planned_s for each in ways])
    out: dict[str, Any] = {
        "tasks": len(ways),
        "found": len(found),
        "found_share_95": [round(among.low or 0.0, 4), round(among.high or 0.0, 4)],
        "planned_ms_median": round(float(np.median(planned)), 1),
        "planned_ms_p99": round(float(np.percentile(planned, 99)), 1),
    }
    if found:
        out |= {
            "duration_s_median": round(float(np.median([each.duration for each in found])), 2),
            "duration_s_p95": round(float(np.percentile([each.duration for each in found], 95)), 2),
            "length_rad_median": round(float(np.median([each.length for each in found])), 2),
            "clearance_mm_least": round(1e3 * min(each.clearance for each in found), 1),
            "too_near": sum(each.clearance < _CLEARANCE for each in found),
            "with_corners": sum(each.corners > 0 for each in found),
        }
    return out


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("approach", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="first row (default: 0)")
    parser.add_argument("--count", type=int, default=5, help="rows (default: 5)")
    parser.add_argument("--most", type=int, default=60, help="tasks at most (default: 60)")
    parser.add_argument(
        "--seconds", type=float, default=1.0, help="longest search of OMPL, which aorrtc uses up (default: 1)"
    )
    parser.add_argument(
        "--planner", choices=PLANNERS, nargs="+", default=["ours"], help="(default: ours); the others need `make peers`"
    )
    arguments = parser.parse_args(argv)
    if arguments.count < 1 or arguments.most < 1 or not arguments.seconds > 0.0:
        parser.error("--count and --most must be at least 1, --seconds more than 0")
    limits = plan_limits(RobotModel(), BASE.speed, BASE.yaw_rate, clearance=_CLEARANCE)
    asked: list[Task] = []
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        asked += tasks(seed, limits)[: arguments.most - len(asked)]
    if not asked:
        print("No row has a cut that the arm can be held before: give other rows.")
        write(arguments.json, {"tasks": 0, "summary": {}, "results": []})
        return 0
    results = {name: [way(task, name, limits, arguments.seconds) for task in asked] for name in arguments.planner}
    summary = {name: summarise(ways) for name, ways in results.items()}
    print(f"{'':<22}" + "".join(f"{name:>14}" for name in summary))
    for key in dict.fromkeys(key for found in summary.values() for key in found):
        print(f"{key:<22}" + "".join(f"{found.get(key, '–')!s:>14}" for found in summary.values()))
    rows = [{"planner": name, **asdict(each)} for name, ways in results.items() for each in ways]
    write(arguments.json, {"seconds": arguments.seconds, "summary": summary, "results": rows})
    return 0
