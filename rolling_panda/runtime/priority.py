"""Who gets the processor first: what keeps time before what looks good.

A stalled bridge or controller stops the robot, as it must, so on a busy machine they come before everything else.
Without the permission (an ordinary user's) they run like any other program, and only the rest steps back.
"""

import contextlib
import os
from typing import Literal

Role = Literal["control", "interface", "sight", "background"]
#: Low among real-time priorities: above every ordinary program, below the kernel's own threads.
_REAL_TIME = 10
_NICE = {"interface": -10, "sight": -5, "background": 5}


def take_priority(role: Role) -> None:
    """Set this process's scheduling; threads and children that it starts later inherit it.

    Args:
        role: `control` keeps a period (real-time round robin), `interface` answers people at once, `sight` follows the
            camera, `background` may wait.
    """
    if role == "control":
        with contextlib.suppress(PermissionError, OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_REAL_TIME))
        return
    with contextlib.suppress(PermissionError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(PermissionError, OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE[role])
