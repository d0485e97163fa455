"""`rolling-panda bridge`: the robot's side of the wire."""

import argparse
import gc
import sys
from collections.abc import Sequence
from pathlib import Path

from bridge.cut_memory import CutFile
from bridge.loop import BridgeLoop
from rolling_panda.process import ProcessContext, run_process


def main(argv: Sequence[str] | None = None) -> int:
    """Run the bridge; returns the exit code."""
    return run_process("bridge", "The robot, with its own watchdog, limits and latched stop.", _run, _arguments, argv)


def _arguments(parser: argparse.ArgumentParser) -> None:
    def kind(text: str) -> str:
        if text == "real":
            parser.exit(1, f"{parser.prog}: the real robot is not part of this version; run: {parser.prog} sim\n")
        if text != "sim":
            raise argparse.ArgumentTypeError(f"{text!r} is no robot; choose sim")
        return text

    parser.add_argument("kind", nargs="?", type=kind, default="sim", metavar="sim|real", help="robot (default: sim)")
    parser.add_argument("--seed", type=_seed, default=0, help="of the simulated vineyard (default: 0)")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="record what the simulation really actuates")


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no seed; give a whole number from 0")
    return int(text)


def _run(context: ProcessContext) -> None:
    arguments = context.arguments
    # Here and not above: a bridge to a real robot must not need the simulator.
    from bridge.sim.build import simulated_bridge

    cuts = CutFile(context.state_folder)
    core = simulated_bridge(
        context.config_path, arguments.seed, arguments.trace, "process", context.transport.rejections, cuts=cuts
    )
    gc.freeze()
    try:
        BridgeLoop(core, context.transport).run(context.stopping)
    finally:
        core.robot.close()
        cuts.close()


if __name__ == "__main__":
    sys.exit(main())
