"""`rolling-panda bench reach`: tool poses anywhere around the robot, by a kinematic robot under closed-loop control."""

import argparse
import math
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import share
from benchmarks.control import reach_targets
from benchmarks.control.arm_ik import ArmIk
from benchmarks.control.reach_judge import Quality, Trajectory, judge
from benchmarks.control.reach_run import BASE, METHODS, MethodName, Runner
from benchmarks.control.reach_targets import Target
from controller.whole_body.manipulability import arm_omega
from rolling_panda.errors import RollingPandaError

#: Targets that one process is given at a time.
_BATCH = 4
#: Targets whose ω is written along the way, every so many rows.
_SAMPLED, _SAMPLE_EVERY = 8, 10
_runner: Runner | None = None


@dataclass(frozen=True)
class Row:
    """One target's result.

    Attributes:
        target: Its index.
        distance: Of the goal from the base at the start, along the ground (m).
        quality: Judgement of the motion.
        infeasible_ticks: Control periods in which the method could not do all that was asked.
        planned_s: Processor time of planning (s).
        beyond_reach: True where geometry alone proves that no posture from anywhere has the tool there.
        reason: Why it was refused or what was in the way; empty where nothing was.
        omega: Times (s) and ω of the arm on the way, for the first targets; empty for the others.
    """

    target: int
    distance: float
    quality: Quality
    infeasible_ticks: int
    planned_s: float
    beyond_reach: bool
    reason: str
    omega: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())


def main(argv: Sequence[str]) -> int:
    """Run, print, and write the figures. Returns the exit code."""
    return _run(_parser().parse_args(argv))


def run(targets: Sequence[Target], method: MethodName, seed: int, jobs: int, folder: Path | None = None) -> list[Row]:
    """Every target in order.

    Args:
        targets: What to reach.
        method: Of control.
        seed: Of the planner.
        jobs: Processes; 1 runs in this one.
        folder: Where trajectories are written, one file a target.
    """
    rows = list(_rows(targets, method, seed, jobs, folder))
    return sorted(rows, key=lambda row: row.target)


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """Shares and figures over all targets."""
    reached = sum(row.quality.reached for row in rows)
    possible = sum(not row.beyond_reach for row in rows)
    moved = [row.quality for row in rows if row.quality.duration > 0.0] or [row.quality for row in rows]
    done = [row.quality for row in rows if row.quality.reached] or moved
    among = share(reached, len(rows))

    def broken(kind: str) -> dict[str, float]:
        counts = [getattr(quality.violations, kind) for quality in moved]
        sizes = [getattr(quality.violations, f"{kind}_size") for quality in moved]
        return {"count": sum(counts), "targets": sum(count > 0 for count in counts), "largest": max(sizes)}

    return {
        "targets": len(rows),
        "reached": reached,
        "reached_share": round(reached / len(rows), 4),
        "reached_share_95": [round(among.low or 0.0, 4), round(among.high or 0.0, 4)],
        "beyond_reach": len(rows) - possible,
        "reached_share_of_the_others": round(reached / max(possible, 1), 4),
        "violations": {kind: broken(kind) for kind in ("position", "velocity", "acceleration")},
        "rolling_largest": max(quality.rolling for quality in moved),
        "duration_s_median": round(float(np.median([quality.duration for quality in done])), 2),
        "duration_s_max": round(max(quality.duration for quality in done), 2),
        "base_travel_m_mean": round(float(np.mean([quality.base_travel for quality in done])), 3),
        "omega_mean": round(float(np.mean([quality.omega_mean for quality in moved])), 4),
        "omega_least": round(min(quality.omega_least for quality in moved), 4),
        "joint_margin_rad_least": round(min(quality.margin_least for quality in moved), 4),
        "clearance_m_least": round(min(quality.clearance_least for quality in moved), 4),
        "clearance_m_least_at_a_start": round(min(quality.clearance_start for quality in moved), 4),
        "clearance_m_lost": round(max(quality.clearance_lost for quality in moved), 4),
        "infeasible_ticks": sum(row.infeasible_ticks for row in rows),
        "planning_ms_mean": round(1e3 * float(np.mean([row.planned_s for row in rows])), 1),
    }


def _parser() -> argparse.ArgumentParser:
    parser = bench_parser(
        "reach",
        "From rest at a configuration to rest with the tool at a pose, within 1 mm, 0.5° and 30 s, on a "
        "kinematic robot (0.8 m/s and 0.6 rad/s for the base, the arm's full rates). Limits are judged by finite "
        "differences of what was done.",
    )
    parser.add_argument("--targets", type=Path, metavar="FILE", help="targets as JSON; without it they are drawn")
    parser.add_argument("--seed", type=int, default=0, help="of drawn targets and of the planner (default: 0)")
    parser.add_argument("--count", type=int, default=100, help="targets to draw (default: 100)")
    parser.add_argument(
        "--starts", choices=("survey", "anywhere"), default="survey", help="posture of drawn starts (default: survey)"
    )
    parser.add_argument("--free-axis", choices=("none", "tool_y"), default="none", help="of drawn targets")
    parser.add_argument("--method", choices=METHODS, default="hierarchy", help="(default: hierarchy)")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes (default: all cores)")
    parser.add_argument("--trajectories", type=Path, metavar="DIR", help="write t, q, xi of each target as npz here")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    if arguments.count < 1 or arguments.jobs < 1:
        raise RollingPandaError("--count and --jobs must be at least 1")
    targets = (
        reach_targets.read(arguments.targets)
        if arguments.targets is not None
        else reach_targets.draw(arguments.seed, arguments.count, arguments.free_axis, arguments.starts == "anywhere")
    )
    for path in (arguments.trajectories, arguments.json.parent if arguments.json is not None else None):
        if path is not None:
            _make(path)
    began = time.perf_counter()
    rows = run(targets, arguments.method, arguments.seed, arguments.jobs, arguments.trajectories)
    summary = summarise(rows)
    _print(arguments.method, rows, summary, time.perf_counter() - began)
    document = {
        "method": arguments.method,
        "targets": str(arguments.targets or f"drawn: seed {arguments.seed}, free axis {arguments.free_axis}"),
        "summary": summary,
        "samples": [{"target": row.target, "t": row.omega[0], "omega": row.omega[1]} for row in rows[:_SAMPLED]],
        "results": [_flat(row) for row in rows],
    }
    write(arguments.json, document)
    return 0


def _rows(targets: Sequence[Target], method: MethodName, seed: int, jobs: int, folder: Path | None) -> Iterator[Row]:
    batches = [range(i, min(i + _BATCH, len(targets))) for i in range(0, len(targets), _BATCH)]
    done = reached = 0
    if jobs == 1:
        _begin(method, seed)
        found = (_batch([(i, targets[i]) for i in batch], folder) for batch in batches)
        yield from (row for rows in found for row in rows)
        return
    # One thread of linear algebra a process: there are as many processes as cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with ProcessPoolExecutor(jobs, get_context("spawn"), _begin, (method, seed)) as pool:
        futures = [pool.submit(_batch, [(i, targets[i]) for i in batch], folder) for batch in batches]
        for future in as_completed(futures):
            for row in future.result():
                done, reached = done + 1, reached + row.quality.reached
                yield row
            if sys.stderr.isatty() or done % 100 < _BATCH:
                end = "\r" if sys.stderr.isatty() else "\n"
                print(f"{done} of {len(targets)}, {reached} reached", end=end, file=sys.stderr, flush=True)


def _begin(method: MethodName, seed: int) -> None:
    global _runner
    _runner = Runner(method, seed)


def _batch(targets: list[tuple[int, Target]], folder: Path | None) -> list[Row]:
    assert _runner is not None
    return [_row(_runner, index, target, folder) for index, target in targets]


def _row(runner: Runner, index: int, target: Target, folder: Path | None) -> Row:
    outcome = runner.run(target.q, target.T_odom_goal, target.free)
    done = outcome.trajectory
    if folder is not None:
        np.savez_compressed(folder / f"target_{index:04d}.npz", t=done.t, q=done.q, xi=done.xi)
    quality = judge(runner.robot, runner.collision, BASE, done, target.T_odom_goal, target.free)
    beyond = reach_targets.beyond(ArmIk(runner.robot), target) is not None
    reason = outcome.reason
    if not quality.reached and not reason:
        reason = "the motion ended or ran out of time before the tool was there"
    distance = math.dist(target.T_odom_goal.translation[:2], target.q[:2])
    omega = _omega(runner, done) if index < _SAMPLED else ((), ())
    return Row(index, distance, quality, outcome.infeasible, outcome.planned_s, beyond, reason, omega)


def _omega(runner: Runner, done: Trajectory) -> tuple[tuple[float, ...], tuple[float, ...]]:
    rows = range(0, len(done.t), _SAMPLE_EVERY)
    values = [arm_omega(runner.robot.kinematics(done.q[row]).J) for row in rows]
    return tuple(round(float(done.t[row]), 3) for row in rows), tuple(round(value, 5) for value in values)


def _print(method: str, rows: Sequence[Row], summary: dict[str, Any], seconds: float) -> None:
    low, high = summary["reached_share_95"]
    print(f"{method}, {len(rows)} targets in {seconds:.0f} s")
    print(
        f"  reached (1 mm, 0.5°, 30 s)   {summary['reached']}"
        f" = {summary['reached_share']:.1%} ({low:.1%} to {high:.1%})"
    )
    if summary["beyond_reach"]:
        others = summary["reached_share_of_the_others"]
        print(
            f"  out of reach from anywhere   {summary['beyond_reach']}, proven by geometry; of the others {others:.1%}"
        )
    for kind, unit in (("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s²")):
        found = summary["violations"][kind]
        size = f", largest {found['largest']:.3g} {unit}, in {found['targets']} targets" if found["count"] else ""
        print(f"  {kind + ' limits broken':<29}{found['count']}{size}")
    print(f"  rolling, largest ‖A q̇‖       {summary['rolling_largest']:.1e}")
    print(
        f"  duration                     {summary['duration_s_median']} s median, {summary['duration_s_max']} s at most"
    )
    print(f"  base travel                  {summary['base_travel_m_mean']} m mean")
    print(f"  ω of the arm                 {summary['omega_mean']} mean, {summary['omega_least']} least")
    print(f"  joint margin                 {summary['joint_margin_rad_least']} rad least")
    print(
        f"  clearance                    {summary['clearance_m_least']} m least, at a start "
        f"{summary['clearance_m_least_at_a_start']} m; at most {summary['clearance_m_lost']} m below start or margin"
    )
    print(f"  infeasible ticks             {summary['infeasible_ticks']}")
    print(f"  planning                     {summary['planning_ms_mean']} ms mean")
    failed = [row for row in rows if not row.quality.reached]
    for reason, count in Counter(_kind(row.reason) for row in failed).most_common(8):
        print(f"  {count:>4} not reached: {reason}")
    for row in [row for row in failed if not row.beyond_reach][:20]:
        millimetres, degrees = 1e3 * row.quality.position_error, math.degrees(row.quality.rotation_error)
        print(f"  target {row.target}: {millimetres:.1f} mm and {degrees:.1f}° left")


def _kind(reason: str) -> str:
    """A reason without its numbers, to count alike ones together."""
    return re.sub(r"-?\d+(\.\d+)?", "…", reason)


def _flat(row: Row) -> dict[str, Any]:
    fields: dict[str, Any] = asdict(row)
    del fields["omega"]
    quality: dict[str, Any] = fields.pop("quality")
    return fields | quality


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RollingPandaError(f"cannot write to {folder}: {error.strerror}") from error
