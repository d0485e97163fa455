"""Run the peers' scripts, each with the Python that has the peer; without one it is absent, and never a number."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.peers.problem import write_problem
from controller.config import ControllerConfig
from controller.whole_body.task import IkProblem

#: Name, script, and the package to install in an environment of its own.
PEERS = (
    ("Pink", "pink_step.py", "pin-pink"),
    ("mink", "mink_step.py", "mink"),
    ("PlaCo", "placo_step.py", "placo"),
    ("TSID", "tsid_step.py", "tsid"),
)
_LIMIT_S = 180.0
#: Share of the problems that may be without an answer.
_FEW = 0.05


def run_peers(
    demands: Sequence[IkProblem], config: ControllerConfig, environments: Path | None
) -> list[dict[str, Any]]:
    """One entry for each peer: its figures, or `absent` with the reason.

    Args:
        demands: The problems.
        config: Of the controller.
        environments: Folder with a virtual environment for each peer, named after its package; where there is none,
            this Python is tried.
    """
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_problem(folder, demands, config)
        for peer, script, package in PEERS:
            own = None if environments is None else environments / package / "bin" / "python"
            python = str(own) if own is not None and own.exists() else sys.executable
            found.append({"name": peer, **run_script(python, Path(__file__).parent / script, folder)})
    return found


def run_script(python: str, script: Path, folder: Path) -> dict[str, Any]:
    """Figures of one script on the problem in `folder`, or `absent` with the reason."""
    try:
        done = subprocess.run(
            [python, str(script), str(folder)], capture_output=True, text=True, timeout=_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return {"absent": f"no answer within {_LIMIT_S:.0f} s"}
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines()
        return {"absent": lines[-1] if lines else f"exit code {done.returncode}"}
    figures: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    if figures["failed"] > _FEW * figures["steps"]:
        # The time it takes to find no answer is not the time of a step.
        return {"absent": f"no answer to {figures['failed']} of {figures['steps']} problems"}
    return figures
