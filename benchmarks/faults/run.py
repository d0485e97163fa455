"""`rolling-panda bench faults`: random faults at random times, judged by what the actuators were sent.

Each trial starts from automatic work, a base driven by hand or a tool led by hand in full motion, lets a random time
pass and injects one fault. Times run from the fault to the moment from which on the bridge sends nothing but zero. Most
trials are of bridge and controller in one process, on a simulated clock; with `--live` they are of the real processes
over the real wire, behind a router that can fail; with `--cuts` at the instants around a cut
(`benchmarks.faults.cut_faults`).
"""

import argparse
import json
import math
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import msgspec

from benchmarks.common.documents import write
from benchmarks.faults.cut_faults import CUT_FAULTS, Report, run_cut_faults, table
from benchmarks.faults.forked_trials import apart
from benchmarks.faults.judge import Trial, braking_after, judge, last_taken, summary
from benchmarks.faults.kinds import FAULTS, Fault
from benchmarks.faults.live_fault_kinds import LIVE_FAULTS, LiveFault
from benchmarks.faults.live_faults import run_live
from rolling_panda.resources import resource
from tests.support.worlds.faulty_world import FaultyWorld


def start(fault: Fault) -> FaultyWorld:
    """A world in the motion in which the fault is to happen."""
    world = FaultyWorld(0, fault.speed)
    {"work": world.work, "base": world.drive, "tool": world.lead}[fault.moving]()
    return world


def run_trial(fault: Fault, world: FaultyWorld, seed: int) -> Trial:
    """Let a random time pass and the fault happen."""
    world.rng.seed(seed)
    world.run(world.rng.uniform(0.0, 0.5))
    at = world.now
    fault.inject(world)
    world.run(fault.watched_s)
    rows = world.robot.trace().rows
    since = at if fault.since == "fault" else last_taken(rows)
    found = judge(rows, world.robot.begun, since, fault.limit_s)
    braking = braking_after(rows, at)
    return Trial(fault.name, fault.requirement, seed, fault.limit_s, world.controller.mode, braking, *found)


def deal(chosen: Sequence[Fault], seed: int, trials: int) -> Iterator[tuple[Fault, list[int]]]:
    """Each fault with the seeds of its trials, the same whatever else is chosen.

    `trials` are for a requirement, dealt out to its faults.
    """
    for fault in chosen:
        number = FAULTS.index(fault)
        same = [other for other in chosen if other.requirement == fault.requirement]
        place = same.index(fault)
        yield fault, [seed + 10_000 * number + k for k in range(trials) if k % len(same) == place]


def row_of(trial: Trial) -> dict[str, object]:
    """The trial as a row of the document, in which what is not finite is null."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in asdict(trial).items()
    }


def tell(trials: Sequence[Trial]) -> None:
    """A line for each fault: the worst time, its limit, and whether it held."""
    for name in dict.fromkeys(trial.fault for trial in trials):
        those = [trial for trial in trials if trial.fault == name]
        worst = max(trial.quiet_s for trial in those)
        failed = sum(not trial.held for trial in those)
        words = f"held in {len(those)}" if not failed else f"NOT HELD in {failed} of {len(those)}"
        print(f"{those[0].requirement:<8}{name:<48}{worst:8.3f} s of {those[0].limit_s:5.2f}  {words}", flush=True)


def _in_one_process(chosen: Sequence[Fault], seed: int, trials: int) -> list[Trial]:
    out: list[Trial] = []
    print(f"seed {seed}, {trials} trials of each requirement, {len(chosen)} faults", flush=True)
    for fault, seeds in deal(chosen, seed, trials):
        if seeds:
            world = start(fault)
            those = [apart(partial(run_trial, fault, world, seed)) for seed in seeds]
            tell(those)
            out += those
    return out


def _between_processes(chosen: Sequence[LiveFault], seed: int, seconds: float, pages: int) -> list[Trial]:
    print(f"seed {seed}, {len(chosen)} faults with the real processes for {seconds:.0f} s, {pages} pages", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        config = None
        if pages:
            config = Path(folder) / "loaded.toml"
            config.write_text(loaded(), encoding="utf-8")
        out = run_live(chosen, seed, seconds, Path(folder), config, pages)
    tell(sorted(out, key=lambda trial: trial.requirement))
    return out


def _around_cuts(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    """Trials around cuts; a file that a run before has written is gone on with."""
    file: Path | None = arguments.json
    chosen = [fault for fault in CUT_FAULTS if any(text in fault.name for text in arguments.only)]
    if not chosen or arguments.cuts < 1:
        names = ", ".join(fault.name for fault in CUT_FAULTS)
        parser.error(f"--cuts {arguments.cuts} --only {' '.join(arguments.only)!r} is no trial; faults are {names}")

    def keep(report: Report) -> None:
        write(file, {"seed": arguments.seed, **msgspec.to_builtins(report)})

    before = Report()
    if file is not None and file.exists():
        before = msgspec.convert(json.loads(file.read_text(encoding="utf-8")), Report)
        print(f"{len(before.trials)} trials are in {file} already", flush=True)
    folder = Path(tempfile.mkdtemp(prefix="rolling-panda-cuts-"))
    say = partial(print, flush=True)
    report = run_cut_faults(chosen, arguments.cuts, arguments.seed, folder, say, keep, before)
    if len(report.findings) == len(before.findings):
        shutil.rmtree(folder)
    print("\n".join(table(report)), flush=True)
    return 1 if report.findings or not report.trials else 0


def loaded() -> str:
    """The simulation's configuration with ten pictures a second."""
    text = resource("assets/config/sim.toml").read_text(encoding="utf-8")
    return re.sub(r"^camera_(moving|resting)_hz = .*$", r"camera_\1_hz = 10.0", text, flags=re.MULTILINE)


def main(argv: Sequence[str]) -> int:
    """Run trials; returns 0 when every requirement held."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench faults", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of the trials (default: 0)")
    parser.add_argument(
        "--trials", type=int, default=6, help="of each requirement, dealt out to its faults (default: 6)"
    )
    parser.add_argument(
        "--live", type=float, metavar="SECONDS", help="so long with the real processes instead, faults drawn by --seed"
    )
    parser.add_argument(
        "--cuts",
        type=int,
        metavar="N",
        help="so many of each fault at the instants around a cut, between real processes",
    )
    parser.add_argument(
        "--pages", type=int, default=0, help="with --live: that look on, a fifth never reading, at 10 pictures a second"
    )
    parser.add_argument(
        "--only", metavar="TEXT", nargs="+", default=[""], help="requirements, or parts of the names of faults"
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write there what was found; with --cuts, go on from what is there"
    )
    arguments = parser.parse_args(argv)
    if arguments.cuts is not None:
        return _around_cuts(parser, arguments)

    def wanted(fault: Fault | LiveFault) -> bool:
        return any(text in (fault.requirement, "") or text in fault.name for text in arguments.only)

    live = [fault for fault in LIVE_FAULTS if wanted(fault)]
    chosen = [fault for fault in FAULTS if wanted(fault)]
    if not (chosen if arguments.live is None else live):
        known = ", ".join(sorted({fault.requirement for fault in FAULTS}))
        parser.error(f"--only {' '.join(arguments.only)!r} is in no fault's name; requirements are {known}")
    if arguments.live is None:
        trials = _in_one_process(chosen, arguments.seed, arguments.trials)
    else:
        trials = _between_processes(live, arguments.seed, arguments.live, arguments.pages)
    found = summary(trials)
    document = {
        "seed": arguments.seed,
        "world": "one process" if arguments.live is None else "real processes",
        "pages": arguments.pages,
        "summary": found,
        "results": [row_of(trial) for trial in trials],
    }
    write(arguments.json, document)
    return 0 if found and all(entry["held"] for entry in found.values()) else 1
