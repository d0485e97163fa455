"""What keeps time runs before what may wait."""

import os
import subprocess
import sys

import pytest

SHOW = """
import os, sys
from rolling_panda.runtime.priority import take_priority
for role in sys.argv[1:]:
    take_priority(role)
print(os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0))
"""


def scheduling(*roles: str) -> tuple[int, int]:
    """Scheduling policy and niceness of a process that takes these roles, one after the other."""
    done = subprocess.run([sys.executable, "-c", SHOW, *roles], capture_output=True, text=True, check=True)
    policy, nice = done.stdout.split()
    return int(policy), int(nice)


def test_background_work_steps_back_even_when_its_parent_keeps_time() -> None:
    for roles in (("background",), ("control", "background")):
        policy, nice = scheduling(*roles)
        assert policy == os.SCHED_OTHER
        assert nice > 0


def test_control_is_real_time_where_that_is_permitted() -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        permitted = False
    else:
        permitted = True
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    assert scheduling("control")[0] == (os.SCHED_RR if permitted else os.SCHED_OTHER)


@pytest.mark.parametrize("role", ["control", "interface", "sight", "background"])
def test_no_role_fails_without_permission(role: str) -> None:
    limited = "import resource; resource.setrlimit(resource.RLIMIT_NICE, (0, 0));" + SHOW
    done = subprocess.run([sys.executable, "-c", limited, role], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
