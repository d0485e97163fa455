"""A child's wall clock is set while it runs, its monotonic clock is not."""

import subprocess
import sys
import time

import pytest

from rolling_panda.runtime.launch import child_environment
from tests.support.processes.wall_clock import WallClock

_ASK = "import sys, time\nfor _ in sys.stdin: print(time.time(), time.monotonic(), flush=True)"


@pytest.mark.processes
def test_a_childs_wall_clock_jumps_and_its_monotonic_clock_does_not(tmp_path):
    clock = WallClock(tmp_path)
    child = subprocess.Popen(
        [sys.executable, "-c", _ASK],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment() | clock.environment,
    )

    def ask():
        child.stdin.write("\n")
        child.stdin.flush()
        return tuple(map(float, child.stdout.readline().split()))

    try:
        for ahead in (0, 3600, -3600, 10 * 365 * 86400, -10 * 365 * 86400):
            clock.set(ahead)
            wall, monotonic = ask()
            assert wall == pytest.approx(time.time() + ahead, abs=2.0)
            assert monotonic == pytest.approx(time.monotonic(), abs=2.0)
    finally:
        child.communicate()
