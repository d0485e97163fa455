"""Tracking error: integrated commands against measurements. Pure."""

import math

import numpy as np

from controller.whole_body.compiled import COUNT, NOTHING, NUMBER, VECTOR, compiled
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.model.differential_drive import NXI, Array

#: Largest tracking error of wheels and joints (rad). In motion at full speed the servos'
#: lag and the wire's take up 0.1 rad of a joint and 0.3 rad of a wheel.
WHEELS_RAD, JOINTS_RAD = 1.0, 0.35
#: Time constant of the decay of old errors (s).
_FORGETS_S = 1.0
#: Longest gap between two joint states that is integrated (s).
_GAP_S = 0.06
_LIMIT = np.array([WHEELS_RAD] * 2 + [JOINTS_RAD] * (NXI - 2))


class TrackingErrorMonitor:
    """Integrates the difference between commanded and measured velocity, on the bridge's clock."""

    def __init__(self) -> None:
        """Nothing has been sent."""
        self._behind: Array = np.zeros(NXI)
        self._stamp = -math.inf

    def update(self, joints: m.JointState, sent: Array) -> None:
        """Take in a joint state and the ξ̇ (9, rad/s) sent before it; the same one again changes nothing."""
        passed = joints.header.stamp - self._stamp
        self._stamp = joints.header.stamp
        if not 0.0 < passed <= _GAP_S:
            if passed != 0.0:
                self._behind = np.zeros(NXI)
            return
        _integrate(self._behind, sent, np.array(joints.velocity), passed)

    @property
    def reason(self) -> m.Reason | None:
        """The largest tracking error above its limit; None without one."""
        worst = _worst(self._behind, _LIMIT)
        if worst < 0:
            return None
        name = ("the left wheel", "the right wheel")[worst] if worst < 2 else f"joint {worst - 1}"
        return reasons.tracking_error(name, float(abs(self._behind[worst])), float(_LIMIT[worst]))


@compiled(NOTHING(VECTOR, VECTOR, VECTOR, NUMBER))
def _integrate(behind: Array, sent: Array, velocity: Array, passed: float) -> None:
    """Advance the tracking error `behind` (9, rad) by `passed` (s) of commands and measurements (9, rad/s)."""
    for i in range(len(behind)):
        behind[i] += passed * (sent[i] - velocity[i] - behind[i] / _FORGETS_S)


@compiled(COUNT(VECTOR, VECTOR))
def _worst(behind: Array, limit: Array) -> int:
    """Index of the tracking error (9, rad) that is furthest beyond its limit (9, rad); -1 if none is."""
    worst, excess = -1, 0.0
    for i in range(len(behind)):
        # Written so that an error that is no number counts as one.
        if not abs(behind[i]) - limit[i] <= excess:
            worst, excess = i, abs(behind[i]) - limit[i]
    return worst
