import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from controller.whole_body.manipulability import ArmManipulability

ROOT = Path(__file__).parents[2]
_MODULE = """
from controller.whole_body.compiled import NUMBER, compiled

@compiled(NUMBER(NUMBER))
def twice(x):
    return 2.0 * x
"""


def run(folder, code):
    """What a Python of its own prints, with a module `doubling` in `folder` and no other place for machine code."""
    (folder / "doubling.py").write_text(_MODULE)
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{ROOT}", "PYTHONDONTWRITEBYTECODE": "1"}
    environment["XDG_CACHE_HOME"] = environment["HOME"] = "/dev/null"
    environment.pop("NUMBA_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_machine_code_is_kept_for_the_next_start(tmp_path):
    code = "import doubling; print(doubling.twice(2.0), sum(doubling.twice.stats.cache_hits.values()))"
    assert run(tmp_path, code) == ["4.0", "0"]
    assert run(tmp_path, code) == ["4.0", "1"]


def test_without_a_place_to_keep_it_every_start_compiles(tmp_path):
    # A file where the folder would be keeps everybody out, root too.
    (tmp_path / "__pycache__").write_text("")
    code = "import doubling; print(doubling.twice(2.0))"
    assert run(tmp_path, code) == ["4.0"]
    assert run(tmp_path, code) == ["4.0"]


def test_other_types_are_refused_and_not_compiled_for():
    with pytest.raises(TypeError):
        ArmManipulability().at(np.zeros((6, 12), dtype=np.float32))
