"""Scheduling of a process: its priority, the pauses of its garbage collector, and the memory that it has done with.

A bridge or controller that stalls stops the robot, so on a busy machine they run before everything else. The server
comes next, as the software stop of the page goes through it. Without the permission to raise priorities they run like
any other program, and only the other processes lower theirs.
"""

import contextlib
import ctypes
import gc
import os
from pathlib import Path
from typing import Literal

Priority = Literal["control", "interface", "perception", "background"]
#: Low among real-time priorities: above every ordinary program, below the kernel's own threads.
_REAL_TIME: dict[str, int] = {"control": 10, "interface": 5}
#: `madvise`: the kernel may reclaim these pages now; those of a file are read from it again where they are used.
_MADV_PAGEOUT = 21
_NICE = {"perception": -5, "background": 5}


def set_priority(priority: Priority) -> None:
    """Set this process's scheduling; threads and children that it starts later inherit it.

    Args:
        priority: `control` is real-time round robin, for control loops; `interface` likewise, after these; the others
            are decreasing nice levels.
    """
    if priority in _REAL_TIME:
        with contextlib.suppress(PermissionError, OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_REAL_TIME[priority]))
        return
    with contextlib.suppress(PermissionError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(PermissionError, OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE[priority])


def keep_from_children() -> None:
    """What this thread starts from now on runs like any other program; the thread itself keeps its scheduling.

    A thread of a control loop's process must not lower its own: it holds the interpreter's lock at times, and the loop
    would wait until it gets a processor.
    """
    with contextlib.suppress(PermissionError, OSError):
        policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, parameters)


def freeze_heap() -> None:
    """Exclude all present objects, which live as long as the process, from garbage collection; free unused memory.

    A full collection stops all threads. The server's imports alone take it a tenth of a second, in which no stop is
    received.
    """
    gc.collect()
    gc.freeze()
    # Only the GNU C library has it.
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def release_library(name: str) -> None:
    """Free the memory of a loaded library that is not used from now on; its file has it again where it is.

    Args:
        name: A part of its file's name.
    """
    with contextlib.suppress(OSError, AttributeError):
        madvise = ctypes.CDLL(None).madvise
        for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
            addresses, *_, path = line.split(maxsplit=5)
            if name in Path(path).name:
                start, end = (int(address, 16) for address in addresses.split("-"))
                madvise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), _MADV_PAGEOUT)
