"""Start of other Python modules of Rolling Panda as processes, by name and without an import."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
# By default, libraries of linear algebra start one thread for each core, which slows down 12×12 matrices and the other
# processes.
_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


def python_command(module: str, arguments: Sequence[str]) -> list[str]:
    """Command line that runs `module` with this interpreter.

    `-P` excludes a folder of the same name in the working directory.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def child_environment() -> dict[str, str]:
    """This environment with linear algebra on one thread, and a checkout on the path; set variables are kept."""
    out = dict(os.environ)
    for name in _ONE_THREAD:
        out.setdefault(name, "1")
    if (_ROOT / "pyproject.toml").exists():
        out["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *filter(None, [out.get("PYTHONPATH")])])
    return out
