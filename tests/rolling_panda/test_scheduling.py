"""Priority of a process, and its garbage collector."""

import mmap
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rolling_panda.runtime.scheduling import release_library

SHOW = """
import os, sys
from rolling_panda.runtime.scheduling import set_priority
for priority in sys.argv[1:]:
    set_priority(priority)
print(os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0), os.sched_getparam(0).sched_priority)
"""


def scheduling(*priorities: str) -> tuple[int, int, int]:
    """Policy, niceness and real-time priority of a process after setting these priorities in turn."""
    done = subprocess.run([sys.executable, "-c", SHOW, *priorities], capture_output=True, text=True, check=True)
    policy, nice, real_time = map(int, done.stdout.split())
    return policy, nice, real_time


def test_background_work_steps_back_even_when_its_parent_keeps_time() -> None:
    for priorities in (("background",), ("control", "background"), ("interface", "background")):
        policy, nice, _ = scheduling(*priorities)
        assert policy == os.SCHED_OTHER
        assert nice > 0


def test_the_control_loops_and_then_the_server_are_real_time_where_that_is_permitted() -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        permitted = False
    else:
        permitted = True
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    control, interface = scheduling("control"), scheduling("interface")
    assert {control[0], interface[0]} == {os.SCHED_RR if permitted else os.SCHED_OTHER}
    assert not permitted or control[2] > interface[2] > 0


@pytest.mark.parametrize("priority", ["control", "interface", "perception", "background"])
def test_no_priority_fails_without_permission(priority: str) -> None:
    limited = "import resource; resource.setrlimit(resource.RLIMIT_NICE, (0, 0));" + SHOW
    done = subprocess.run([sys.executable, "-c", limited, priority], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


GARBAGE = """
import gc, weakref
from rolling_panda.runtime.scheduling import freeze_heap

class Ring: pass

def ring():
    one = Ring()
    one.itself = one
    return weakref.ref(one)

before = ring()
freeze_heap()
after = ring()
gc.collect()
print(len(gc.get_objects()) < 1000, before() is None, after() is None)
"""


def test_what_is_there_is_left_alone_and_what_becomes_garbage_is_not() -> None:
    done = subprocess.run([sys.executable, "-c", GARBAGE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True"] * 3


def resident_kib(name: str) -> int:
    """Memory of the mapped files of this name (KiB)."""
    mapped, size = False, 0
    for line in Path("/proc/self/smaps").read_text().splitlines():
        if "-" in line.partition(" ")[0]:
            mapped = line.endswith(name)
        elif mapped and line.startswith("Rss:"):
            size += int(line.split()[1])
    return size


def test_a_released_library_takes_no_memory_and_still_works(tmp_path: Path) -> None:
    content = os.urandom(1 << 20)
    with (tmp_path / "libvine.so").open("w+b") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
        with mmap.mmap(file.fileno(), 0, mmap.MAP_PRIVATE, mmap.PROT_READ) as library:
            assert library[:] == content and resident_kib("libvine.so") == 1024
            release_library("libvine")
            assert resident_kib("libvine.so") == 0
            assert library[:] == content
