"""Scheduling of a process: its priority, and the pauses of its garbage collector.

A bridge or controller that stalls stops the robot, so on a busy machine they run before everything else. Without the
permission to raise priorities they run like any other program, and only the other processes lower theirs.
"""

import contextlib
import ctypes
import gc
import os
from typing import Literal

Priority = Literal["control", "interface", "perception", "background"]
#: Low among real-time priorities: above every ordinary program, below the kernel's own threads.
_REAL_TIME = 10
_NICE = {"interface": -10, "perception": -5, "background": 5}


def set_priority(priority: Priority) -> None:
    """Set this process's scheduling; threads and children that it starts later inherit it.

    Args:
        priority: `control` is real-time round robin, for control loops; the others are decreasing nice levels.
    """
    if priority == "control":
        with contextlib.suppress(PermissionError, OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_REAL_TIME))
        return
    with contextlib.suppress(PermissionError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(PermissionError, OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE[priority])


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
