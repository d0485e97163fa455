"""Time the peers' steps: here, or by a script with the Python that has the peer. What is not there has no number."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from benchmarks.peers.problem import write_problem
from benchmarks.peers.reactive import reactive
from benchmarks.peers.stopwatch import timed
from controller.config import ControllerConfig
from controller.whole_body.task import IkProblem, ToolTask
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.robot import RobotModel

#: Name, script, and the package to install in an environment of its own.
PEERS = (
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
        environments: Folder with a virtual environment for each peer that has a script, named after its package; where
            there is none, this Python is tried.
    """
    found = [_here("Pink", "pin-pink", demands, config), _here("mink", "mink", demands, config)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_problem(folder, demands, config)
        for peer, script, package in PEERS:
            own = None if environments is None else environments / package / "bin" / "python"
            python = str(own) if own is not None and own.exists() else sys.executable
            found.append({"name": peer, **run_script(python, Path(__file__).parent / script, folder)})
    return found


def _here(name: str, package: str, demands: Sequence[IkProblem], config: ControllerConfig) -> dict[str, Any]:
    """Figures of a peer that is a whole-body method."""
    try:
        method = reactive(name.lower(), RobotModel(), config.whole_body, 1.0 / config.rate_hz)
    except RollingPandaError as error:
        return {"name": name, "absent": str(error)}
    asked = [demand for demand in demands if isinstance(demand.tool, ToolTask)]

    def step(i: int) -> Any:
        solution = method.solve(asked[i])
        return solution.xi if solution.feasible else None

    note = "weighted tasks; limits of position, velocity and acceleration; rolling; no collisions"
    return {"name": name, "version": version(package), "note": note, **timed(step, len(asked))}


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
