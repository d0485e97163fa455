"""Command of the arm in each millisecond: the interpolated newest target within velocity, acceleration and jerk.

The limits hold between consecutive control periods of the arm, starting from its own last command. The delay of the
callback does not matter. For a late or lost packet the control box extrapolates one period with the last acceleration;
it tolerates 19 in a row. Such a series can start at the highest acceleration. So each increase of a velocity leaves
enough margin for the extrapolated periods.
"""

from dataclasses import replace

import numpy as np

from bridge.core.limiter import Limiter, Watchdog
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_XI, Limits

TICK_S = 0.001
# Longest assumed time between two targets (s), so that the delay stays small.
_LONGEST_SPAN = 0.02
# Lost packets in a row; one more stops the arm.
_LOST = 19
# Every joint's acceleration decays in two periods, to half of it in the first. The worst case is two series of
# lost packets with one command in between.
_REPEATS = 1.5 * _LOST
# Fraction of the arm's limits, because the rounding of its control box is unknown.
_SHARE = 0.999


class ArmFollower:
    """Follows target joint velocities that arrive slower than 1 kHz, and holds after its own deadline.

    It interpolates linearly between two targets over the time between them, so that steps of the target become ramps.
    Times are on one monotonic clock (s).
    """

    def __init__(self, limits: Limits, joint_margin: float, fade_s: float, deadline_s: float) -> None:
        """At rest, without a target.

        Args:
            limits: Of the robot, over ξ; the arm's part counts.
            joint_margin: Distance to a joint's limit at which motion towards it has ended (rad).
            fade_s: Silence after which the last target begins to fade.
            deadline_s: Silence after which the target is zero.
        """
        inside = replace(
            limits,
            velocity=_SHARE * limits.velocity,
            acceleration=_SHARE * limits.acceleration,
            jerk=_SHARE * limits.jerk,
        )
        self._limiter = Limiter(inside, float(limits.acceleration[0]), joint_margin, TICK_S, _REPEATS)
        self._watchdog = Watchdog(fade_s, deadline_s)
        self._start = self._target = np.zeros(7)
        self._began, self._span = float("-inf"), TICK_S
        self._desired = np.zeros(9)

    def aim(self, target: Array, at: float) -> None:
        """A target (7, rad/s) was written at `at`."""
        # After silence it starts from the faded value, not from the earlier target.
        self._start = self._watchdog.trust(at) * self._goal(at)
        self._span = min(max(at - self._began, TICK_S), _LONGEST_SPAN)
        self._target, self._began = target, at
        self._watchdog.feed(at)

    def step(self, now: float, q: Array, dq: Array, ddq: Array, hold: bool = False) -> Array:
        """Joint velocities for the next millisecond (7, rad/s).

        Args:
            now: Present time (s).
            q: Measured joint angles (7, rad).
            dq: Last commanded velocities by the arm (7, rad/s); after lost packets it extrapolates them.
            ddq: Last commanded accelerations by the arm (7, rad/s²).
            hold: Brake to rest, whatever the target is.
        """
        self._limiter.go_on_from(dq, ddq * TICK_S)
        self._desired[ARM_XI] = 0.0 if hold else self._watchdog.trust(now) * self._goal(now)
        return self._limiter.step(self._desired, q)[ARM_XI]

    def _goal(self, now: float) -> Array:
        fraction = min(1.0, (now - self._began) / self._span)
        return self._start + fraction * (self._target - self._start)
