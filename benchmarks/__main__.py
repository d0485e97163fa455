"""`python -m benchmarks NAME`: run one benchmark."""

import argparse
import importlib
import signal
import sys
from collections.abc import Sequence

from rolling_panda.errors import RollingPandaError

#: Benchmarks: name, module with `main(argv) -> int`, and one line for people.
BENCHMARKS = {
    "tick": ("benchmarks.control.tick", "time of one control step"),
    "row": ("benchmarks.control.row", "cuts in simulated rows, end to end"),
    "world": ("benchmarks.control.world", "the same in a rough world: calibration, ground, wind, light, blades"),
    "servo": ("benchmarks.control.servo", "pictures on the last way to a cut, and where the blades close"),
    "vine": (
        "benchmarks.control.vine",
        "a whole vine with a reviewer: seconds of machine and person, every cut judged",
    ),
    "reach": ("benchmarks.control.reach", "tool poses anywhere around the robot: reached, limits, manipulability"),
    "approach": (
        "benchmarks.control.approach",
        "the arm's ways to cuts among wood that stays, beside planners of OMPL",
    ),
    "oracle": ("benchmarks.control.oracle", "right cuts that have a plan where everything is known"),
    "arm": ("benchmarks.control.arm", "the arm alone between random poses, beside published figures"),
    "contact": (
        "benchmarks.control.contact",
        "the arm against posts, wires and wood: forces, time to rest, false stops",
    ),
    "page": ("benchmarks.page.latency", "the page in a real browser: hand to robot, robot to screen, with viewers"),
    "attacks": ("benchmarks.page.attacks", "the software stop while slow and flooding clients attack the server"),
    "load": ("benchmarks.page.load", "processor, memory and traffic of the demo"),
    "ledger": ("benchmarks.control.ledger", "what recording costs the control step, on a slow disk too"),
    "record": ("benchmarks.control.record", "what a recorder beside the demo costs the control"),
    "live": ("benchmarks.control.live", "the running demo: control periods on time, round trip, tool error"),
    "perception": ("benchmarks.perception.survey", "surveys of unseen rows, every pruning point judged"),
    "localise": ("benchmarks.perception.localise", "out along the row and back: where is a place that was seen before"),
    "frame-time": (
        "benchmarks.perception.frame_time",
        "pictures that are later than their times tell: the estimate, and points with and without it",
    ),
    "joints": ("benchmarks.perception.joints", "zeros of the arm's joints by the board: before and after"),
    "photographs": ("benchmarks.perception.photographs", "classes of photographs, against masks that people drew"),
    "familiarity": (
        "benchmarks.perception.familiarity",
        "whether pictures unlike those of the training are told apart",
    ),
    "obstacles": ("benchmarks.perception.obstacles", "what stands in the way after ten minutes, against the truth"),
    "real": ("benchmarks.faults.real", "random commands and faults, the real bridge on fakes with monitors"),
    "faults": ("benchmarks.faults.run", "random faults in motion, judged by what the actuators were sent"),
    "clean": ("benchmarks.faults.clean", "an hour of automatic work without a fault: nothing stops by itself"),
    "replay": ("benchmarks.replay", "a recording played into a process as it is now; what it says is compared"),
    "mutation": ("benchmarks.mutation.run", "small changes of what safety rests on: a test has to fail for each"),
    "pictures": ("benchmarks.page.pictures", "the operator's page in each of its states, for the documents"),
    "plots": ("benchmarks.common.plots", "pictures of what the others wrote with --json"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark that the first argument names, with the rest as its arguments. Returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if words and words[0] in BENCHMARKS:
        try:
            code: int = importlib.import_module(BENCHMARKS[words[0]][0]).main(words[1:])
        except RollingPandaError as error:
            print(f"rolling-panda bench {words[0]}: {error}", file=sys.stderr)
            return 1
        return code
    lines = "\n".join(f"  {name:<13}{about}" for name, (_, about) in BENCHMARKS.items())
    parser = argparse.ArgumentParser(
        prog="rolling-panda bench",
        description="Measure the program.",
        epilog=f"benchmarks:\n{lines}\n\n`rolling-panda bench NAME --help` explains one.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=tuple(BENCHMARKS), help="which benchmark")
    parser.parse_args(words)
    return 2


if __name__ == "__main__":
    # The processes that a benchmark starts are ended in its `finally` blocks, which SIGTERM alone would not run.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    sys.exit(main())
