"""Start of other Python modules of Rolling Panda as processes, by name and without an import."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_DEFAULTS = {
    # By default, libraries of linear algebra start one thread for each core, which slows down 12×12 matrices and the
    # other processes.
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "BLIS_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    # By default, the GNU C library keeps freed memory apart for each of many threads.
    "MALLOC_ARENA_MAX": "2",
}


def python_command(module: str, arguments: Sequence[str]) -> list[str]:
    """Command line that runs `module` with this interpreter.

    `-P` excludes a folder of the same name in the working directory.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def child_environment() -> dict[str, str]:
    """This environment with linear algebra on one thread, few heaps, and a checkout on the path.

    Set variables are kept.
    """
    out = dict(os.environ)
    for name, value in _DEFAULTS.items():
        out.setdefault(name, value)
    if (_ROOT / "pyproject.toml").exists():
        out["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *filter(None, [out.get("PYTHONPATH")])])
    return out
