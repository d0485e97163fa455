"""How one Python program of Rolling Panda starts another: by module name, never by importing it."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
# Libraries of linear algebra start a thread a core by default; for 12×12 matrices that only costs, and the processes
# then take the cores from each other.
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

    `-P` keeps a folder of the same name in the user's working directory from being started instead.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def child_environment() -> dict[str, str]:
    """This environment, with linear algebra on one thread, and the checkout on the path where there is one.

    A value that the user has set stays.
    """
    out = dict(os.environ)
    for name in _ONE_THREAD:
        out.setdefault(name, "1")
    if (_ROOT / "pyproject.toml").exists():
        out["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *filter(None, [out.get("PYTHONPATH")])])
    return out
