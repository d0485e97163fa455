"""`rolling-panda bench arm`: the arm alone between random poses; manipulability on the way, and failures.

Published studies of manipulability-maximising control move a Panda from a random configuration to a random reachable
pose and give the mean ω along the motion and the share of failures. Here the same is asked with the base frozen.

What is compared with what: the published controllers react to the goal alone, from their own pairs, which are not
published; `hierarchy` may plan and has to keep clear of itself, its base and the ground, and a refusal counts as a
failure. Pairs here are uniform over the joints, which is hard on ω: `omega_best` is the mean of the greatest ω that any
posture inside the limits has at the goal, and no method can end with more. `nullspace` on the same pairs is the
baseline that can be compared with directly.
"""

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np

from benchmarks.common.documents import bench_parser, write
from benchmarks.control.arm_ik import ArmIk
from benchmarks.control.reach_judge import Quality, judge
from benchmarks.control.reach_run import BASE, MethodName, Runner
from controller.whole_body.manipulability import arm_omega
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q

#: Mean ω and failures of a Panda under published controllers, 6-D poses.
PUBLISHED = (
    ("resolved-rate motion control", 0.0693, 0.124),
    ("Park et al.", 0.0799, 0.185),
    ("MMC, Haviland and Corke", 0.0942, 0.080),
)
#: Distance that random configurations keep from joint limits (rad), and from the robot itself (m).
_MARGIN, _CLEAR = 0.05, 0.02
#: More manipulability than any posture of the arm has: all of it is wanted.
_ALL_OMEGA = 0.16
_runner: Runner | None = None


@dataclass(frozen=True)
class Pair:
    """A start configuration of the arm (7) and the one whose tool pose is the goal (7)."""

    start: Array
    goal: Array


_pairs: list[Pair] = []


@dataclass(frozen=True)
class Row:
    """One pair's result, beside ω at the start and the greatest at the goal, which no method can change."""

    pair: int
    quality: Quality
    omega_start: float
    omega_best: float
    reason: str


def draw(runner: Runner, seed: int, count: int) -> list[Pair]:
    """Uniformly random configurations inside the joint limits and clear of the robot itself and the ground."""
    rng = np.random.default_rng(seed)
    limits = runner.robot.limits
    lower, upper = limits.lower[ARM_Q] + _MARGIN, limits.upper[ARM_Q] - _MARGIN

    def clear() -> Array:
        q = np.zeros(12)
        while True:
            q[ARM_Q] = rng.uniform(lower, upper)
            if runner.collision.least(q).distance > _CLEAR:
                return q[ARM_Q].copy()

    return [Pair(clear(), clear()) for _ in range(count)]


def run(seed: int, count: int, jobs: int, method: MethodName = "hierarchy") -> list[Row]:
    """Every pair in order, in this process or in several."""
    if jobs == 1:
        _begin(seed, method)
        return [_row(seed, count, index) for index in range(count)]
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    rows: list[Row] = []
    with ProcessPoolExecutor(jobs, get_context("spawn"), _begin, (seed, method)) as pool:
        for row in pool.map(_row, *zip(*((seed, count, index) for index in range(count)), strict=True), chunksize=8):
            rows.append(row)
            if len(rows) % 100 == 0:
                print(f"{len(rows)} of {count}", file=sys.stderr, flush=True)
    return rows


def summarise(rows: Sequence[Row]) -> dict[str, float | int]:
    """Mean ω along the motions, mean over the pairs that were reached, and the share that was not."""
    reached = [row for row in rows if row.quality.reached]
    return {
        "pairs": len(rows),
        "failures": len(rows) - len(reached),
        "failure_share": round(1.0 - len(reached) / len(rows), 4),
        "omega_mean": round(float(np.mean([row.quality.omega_mean for row in reached])) if reached else 0.0, 4),
        "omega_start_mean": round(float(np.mean([row.omega_start for row in rows])), 4),
        "omega_best_mean": round(float(np.mean([row.omega_best for row in rows])), 4),
        "limits_broken": sum(row.quality.violations.total for row in rows),
        "duration_s_median": round(float(np.median([row.quality.duration for row in rows])), 2),
        "clearance_m_least": round(min(row.quality.clearance_least for row in rows), 4),
    }


def main(argv: Sequence[str]) -> int:
    """Run, print, and write the figures. Returns the exit code."""
    parser = bench_parser("arm", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="of the pairs and the planner (default: 0)")
    parser.add_argument("--count", type=int, default=1000, help="pairs (default: 1000)")
    parser.add_argument(
        "--method", choices=("hierarchy", "nullspace"), default="hierarchy", help="(default: hierarchy)"
    )
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes (default: all cores)")
    arguments = parser.parse_args(argv)
    if arguments.count < 1 or arguments.jobs < 1:
        parser.error("--count and --jobs must be at least 1")
    rows = run(arguments.seed, arguments.count, arguments.jobs, arguments.method)
    summary = summarise(rows)
    print(f"{'':<42}{'mean ω':>8} {'failures':>9}")
    for name, omega, failures in PUBLISHED:
        print(f"{name + ' (published)':<42}{omega:>8.4f} {failures:>9.1%}")
    name = f"{arguments.method} (here, on its own pairs)"
    print(f"{name:<42}{summary['omega_mean']:>8.4f} {summary['failure_share']:>9.1%}")
    print(", ".join(f"{name} {value}" for name, value in summary.items()))
    for row in [row for row in rows if not row.quality.reached][:10]:
        print(f"  pair {row.pair}: {row.reason or 'ended away from the goal'}")
    write(arguments.json, {"summary": summary, "results": [asdict(row) for row in rows]})
    return 0


def _begin(seed: int, method: MethodName) -> None:
    global _runner
    _runner = Runner(method, seed)
    _pairs.clear()


def _row(seed: int, count: int, index: int) -> Row:
    assert _runner is not None
    if len(_pairs) != count:
        _pairs[:] = draw(_runner, seed, count)
    pair, q = _pairs[index], np.zeros(12)
    q[ARM_Q] = pair.goal
    goal = _runner.robot.pose(q, _runner.robot.tool_id)
    q[ARM_Q] = pair.start
    outcome = _runner.run(q, goal, free=False, base_fixed=True, good_omega=_ALL_OMEGA)
    quality = judge(_runner.robot, _runner.collision, BASE, outcome.trajectory, goal, False)
    return Row(index, quality, arm_omega(_runner.robot.kinematics(q).J), _best(goal), outcome.reason)


def _best(goal: Any) -> float:
    """The greatest ω of any posture inside the limits at a tool pose, over 2,000 last joints."""
    assert _runner is not None
    ik = ArmIk(_runner.robot)
    flange = goal * ik.tool.inverse()
    q7: Array = np.linspace(ik.lower[6], ik.upper[6], 2000)
    n = len(q7)
    at_mount = np.broadcast_to(flange.translation - ik.mount, (n, 3))
    found = ik.solve(np.broadcast_to(flange.rotation, (n, 3, 3)), at_mount, q7)
    inside = np.isfinite(found.omega) & (ik.margin(found.q) > 0.0)
    return float(found.omega[inside].max()) if inside.any() else 0.0
