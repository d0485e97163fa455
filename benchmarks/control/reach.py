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
#: What counts as near (m, rad).
_NEAR = 0.02, math.radians(5.0)
#: Kinds of drawn goals.
_KINDS = ("anywhere", "axis_free", "row")
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
        least_s: Lower bound of the duration (s): each actuator alone; None where no posture is known.
        steps_s: Processor time of each of the method's solutions (s).
    """

    target: int
    distance: float
    quality: Quality
    infeasible_ticks: int
    planned_s: float
    beyond_reach: bool
    reason: str
    omega: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    least_s: float | None = None
    steps_s: tuple[float, ...] = ()


#: Targets, and where they are from; and rows by kind of goals and method.
_Drawn = tuple[Sequence[Target], str]
_Found = dict[tuple[str, MethodName], list[Row]]


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
    settled = [row.quality.settled for row in rows if row.quality.settled is not None]
    ratios = [row.quality.settled / row.least_s for row in rows if row.quality.settled is not None and row.least_s]
    near = sum(q.position_error <= _NEAR[0] and q.rotation_error <= _NEAR[1] for q in (row.quality for row in rows))
    steps_us = 1e6 * np.concatenate([row.steps_s for row in rows]) if any(row.steps_s for row in rows) else np.zeros(1)
    among = share(reached, len(rows))

    def broken(kind: str) -> dict[str, float]:
        counts = [getattr(quality.violations, kind) for quality in moved]
        sizes = [getattr(quality.violations, f"{kind}_size") for quality in moved]
        return {"count": sum(counts), "targets": sum(count > 0 for count in counts), "largest": max(sizes)}

    return {
        "targets": len(rows),
        "reached": reached,
        "near": near,
        "reached_share": round(reached / len(rows), 4),
        "reached_share_95": [round(among.low or 0.0, 4), round(among.high or 0.0, 4)],
        "beyond_reach": len(rows) - possible,
        "reached_share_of_the_others": round(reached / max(possible, 1), 4),
        "violations": {kind: broken(kind) for kind in ("position", "velocity", "acceleration")},
        "rolling_largest": max(quality.rolling for quality in moved),
        "duration_s_median": round(float(np.median([quality.duration for quality in done])), 2),
        "duration_s_max": round(max(quality.duration for quality in done), 2),
        "settled_s_median": round(float(np.median(settled)), 2) if settled else None,
        "settled_over_least_median": round(float(np.median(ratios)), 2) if ratios else None,
        "settled_over_least_p95": round(float(np.percentile(ratios, 95)), 2) if ratios else None,
        "step_us_median": round(float(np.median(steps_us)), 1),
        "step_us_p99": round(float(np.percentile(steps_us, 99)), 1),
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
    parser.add_argument(
        "--goals",
        choices=_KINDS,
        nargs="+",
        default=["anywhere"],
        help="drawn goals: within ±4 m, the same with `--free-axis tool_y`, or like cuts of a row beside the base; one "
        "kind, or several one after the other (default: anywhere)",
    )
    parser.add_argument("--free-axis", choices=("none", "tool_y"), default="none", help="of drawn targets")
    parser.add_argument(
        "--method",
        choices=METHODS,
        nargs="+",
        default=["hierarchy"],
        help="one, or several on the same goals (default: hierarchy); pink, mink, holistic and mpc need `make peers`",
    )
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes (default: all cores)")
    parser.add_argument(
        "--minutes",
        type=float,
        metavar="MINUTES",
        help="take goals one after the other, each with all methods, in one process, and begin none after so long",
    )
    parser.add_argument("--trajectories", type=Path, metavar="DIR", help="write t, q, xi of each target as npz here")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    if arguments.count < 1 or arguments.jobs < 1:
        raise RollingPandaError("--count and --jobs must be at least 1")
    if arguments.minutes is not None and arguments.targets is not None:
        raise RollingPandaError("--minutes is for drawn goals; leave out --targets")
    for path in (arguments.trajectories, arguments.json.parent if arguments.json is not None else None):
        if path is not None:
            _made(path)
    kinds = ["file"] if arguments.targets is not None else list(dict.fromkeys(arguments.goals))
    goals = {kind: _targets(arguments, kind) for kind in kinds}
    documents: list[dict[str, Any]] = []
    for found in (_each if arguments.minutes is None else _in_turn)(arguments, goals):
        documents = [_document(kind, method, goals[kind][1], rows) for (kind, method), rows in found.items()]
        # Whoever waits for the slow ones has the others.
        write(arguments.json, documents[0] if len(documents) == 1 else {"methods": documents})
    for kind in kinds if len(arguments.method) > 1 else []:
        _print_beside(kind, [document for document in documents if document["kind"] == kind])
    return 0


def _each(arguments: argparse.Namespace, goals: dict[str, _Drawn]) -> Iterator[_Found]:
    """One method after the other, each on all goals of a kind."""
    found: _Found = {}
    for kind, (targets, _) in goals.items():
        for method in arguments.method:
            began = time.perf_counter()
            rows = run(targets, method, arguments.seed, arguments.jobs, _folder(arguments, kind, method))
            _print(method, rows, summarise(rows), time.perf_counter() - began)
            found[kind, method] = rows
            yield found


def _in_turn(arguments: argparse.Namespace, goals: dict[str, _Drawn]) -> Iterator[_Found]:
    """One goal of each kind after the other, each with all methods: whenever it ends, all have had the same goals."""
    began = time.perf_counter()
    runners = {method: Runner(method, arguments.seed) for method in arguments.method}
    found: _Found = {(kind, method): [] for kind in goals for method in runners}
    for i in range(arguments.count):
        if i and time.perf_counter() - began > 60.0 * arguments.minutes:
            break
        for (kind, method), rows in found.items():
            rows.append(_row(runners[method], i, goals[kind][0][i], _folder(arguments, kind, method)))
        print(f"{i + 1} of {arguments.count} goals of each kind", file=sys.stderr, flush=True)
        yield found


def _targets(arguments: argparse.Namespace, kind: str) -> _Drawn:
    """The targets of a kind, and where they are from."""
    if arguments.targets is not None:
        return reach_targets.read(arguments.targets), str(arguments.targets)
    free: reach_targets.FreeAxis = "tool_y" if kind == "axis_free" else arguments.free_axis
    goals: reach_targets.Goals = "row" if kind == "row" else "anywhere"
    targets = reach_targets.draw(arguments.seed, arguments.count, free, arguments.starts == "anywhere", goals)
    return targets, f"drawn: seed {arguments.seed}, free axis {free}, goals {goals}"


def _document(kind: str, method: MethodName, told: str, rows: Sequence[Row]) -> dict[str, Any]:
    """What is written of one method and one kind of goals."""
    return {
        "method": method,
        "kind": kind,
        "targets": told,
        "summary": summarise(rows),
        "samples": [{"target": row.target, "t": row.omega[0], "omega": row.omega[1]} for row in rows[:_SAMPLED]],
        "results": [_flat(row) for row in rows],
    }


def _folder(arguments: argparse.Namespace, kind: str, method: str) -> Path | None:
    """Where a method's trajectories go: with several methods, or several kinds of goals, one folder each."""
    folder: Path | None = arguments.trajectories
    if folder is None:
        return None
    if len(arguments.goals) > 1:
        folder = folder / kind
    return _made(folder / method if len(arguments.method) > 1 else folder)


def _print_beside(kind: str, documents: Sequence[dict[str, Any]]) -> None:
    """A line for each method."""
    print(
        f"\n{kind:<12}{'reached':>8}{'95 %':>11}{'near':>6}{'there, s':>10}{'over bound':>12}{'clearance':>12}"
        f"{'mean ω':>8}{'p99 of a step':>15}{'planning':>10}"
    )
    for document in documents:
        found = document["summary"]
        low, high = found["reached_share_95"]
        there, over = (
            "–" if found[key] is None else f"{found[key]:.2f}"
            for key in ("settled_s_median", "settled_over_least_median")
        )
        print(
            f"{document['method']:<12}{found['reached']:>8}{f'{low:.0%}–{high:.0%}':>11}{found['near']:>6}{there:>10}"
            f"{over:>12}{1e3 * found['clearance_m_least']:>9.0f} mm{found['omega_mean']:>8.3f}"
            f"{found['step_us_p99']:>12.0f} µs{found['planning_ms_mean']:>7.0f} ms"
        )


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
    least_s = runner.least_time(target.q, target.T_odom_goal, target.free)
    distance = math.dist(target.T_odom_goal.translation[:2], target.q[:2])
    omega = _omega(runner, done) if index < _SAMPLED else ((), ())
    return Row(
        index, distance, quality, outcome.infeasible, outcome.planned_s, beyond, reason, omega, least_s, outcome.steps_s
    )


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
    print(f"  within 20 mm and 5°          {summary['near']}")
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
    if summary["settled_over_least_median"] is not None:
        print(
            f"  there, and stays             {summary['settled_s_median']} s median; over the lower bound "
            f"{summary['settled_over_least_median']} median, {summary['settled_over_least_p95']} p95"
        )
    print(f"  base travel                  {summary['base_travel_m_mean']} m mean")
    print(f"  ω of the arm                 {summary['omega_mean']} mean, {summary['omega_least']} least")
    print(f"  joint margin                 {summary['joint_margin_rad_least']} rad least")
    print(
        f"  clearance                    {summary['clearance_m_least']} m least, at a start "
        f"{summary['clearance_m_least_at_a_start']} m; at most {summary['clearance_m_lost']} m below start or kept"
    )
    print(f"  infeasible ticks             {summary['infeasible_ticks']}")
    print(f"  one step                     {summary['step_us_median']} µs median, {summary['step_us_p99']} µs p99")
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
    del fields["omega"], fields["steps_s"]
    quality: dict[str, Any] = fields.pop("quality")
    return fields | quality


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RollingPandaError(f"cannot write to {folder}: {error.strerror}") from error
    return folder
