"""`rolling-panda bench faults`: random faults at random times, judged by what the actuators were sent.

Each trial starts from automatic work, a base driven by hand or a tool led by hand in full motion, lets a random time
pass and injects one fault. Times run from the fault to the moment from which on the bridge sends nothing but zero, on
the simulated clock.
"""

import argparse
import math
import random
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.documents import one_row_a_line
from benchmarks.fault_judge import Trial, judge, last_taken, summary
from benchmarks.fault_kinds import FAULTS, Fault
from benchmarks.fault_world import World


def run_trial(fault: Fault, seed: int) -> Trial:
    """One fault in a fresh world."""
    draw = random.Random(seed)
    world = World(seed, fault.speed)
    {"work": world.work, "base": world.drive, "tool": world.lead}[fault.moving]()
    world.run(draw.uniform(0.0, 0.5))
    at, world.modes = world.now, []
    fault.inject(world)
    world.run(fault.watched_s)
    rows = world.robot.trace().rows
    since = at if fault.since == "fault" else last_taken(rows)
    found = judge(rows, world.robot.begun, since, fault.limit_s)
    return Trial(fault.name, fault.requirement, seed, fault.limit_s, world.controller.mode, *found)


def deal(chosen: Sequence[Fault], seed: int, trials: int) -> Iterator[tuple[Fault, list[int]]]:
    """Each fault with the seeds of its trials: `trials` a requirement, dealt out to its faults."""
    for number, fault in enumerate(chosen):
        same = [other for other in chosen if other.requirement == fault.requirement]
        place = same.index(fault)
        yield fault, [seed + 10_000 * number + k for k in range(trials) if k % len(same) == place]


def row_of(trial: Trial) -> dict[str, object]:
    """The trial as a row of the document, in which infinite is null."""
    return {
        name: None if isinstance(value, float) and math.isinf(value) else value for name, value in asdict(trial).items()
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Run trials; returns 0 when every requirement held."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench faults", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of the first trial (default: 0)")
    parser.add_argument(
        "--trials", type=int, default=6, help="of each requirement, dealt out to its faults (default: 6)"
    )
    parser.add_argument("--only", metavar="TEXT", default="", help="faults whose name or requirement has this in it")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write there what was found")
    arguments = parser.parse_args(argv)
    chosen = [fault for fault in FAULTS if arguments.only in (fault.requirement, "") or arguments.only in fault.name]
    if not chosen:
        known = ", ".join(sorted({fault.requirement for fault in FAULTS}))
        parser.error(f"--only {arguments.only!r} is in no fault's name; requirements are {known}")
    trials: list[Trial] = []
    print(f"seed {arguments.seed}, {arguments.trials} trials of each requirement, {len(chosen)} faults", flush=True)
    for fault, seeds in deal(chosen, arguments.seed, arguments.trials):
        those = [run_trial(fault, seed) for seed in seeds]
        trials += those
        worst = max((trial.quiet_s for trial in those), default=0.0)
        failed = sum(not trial.held for trial in those)
        words = f"held in {len(those)}" if not failed else f"NOT HELD in {failed} of {len(those)}"
        print(f"{fault.requirement:<8}{fault.name:<48}{worst:8.3f} s of {fault.limit_s:5.2f}  {words}", flush=True)
    found = summary(trials)
    if arguments.json is not None:
        document = {
            "seed": arguments.seed,
            "trials": arguments.trials,
            "summary": found,
            "results": [row_of(trial) for trial in trials],
        }
        arguments.json.write_text(one_row_a_line(document), encoding="utf-8")
    return 0 if all(entry["held"] for entry in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
