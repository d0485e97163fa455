"""What the arm is told each millisecond: the newest target, interpolated, within velocity, acceleration and jerk.

The limits hold from one period of the arm's to the next, from what the arm itself took: how late the callback is by the
clock plays no part in them. A packet that comes too late or is lost is one more period with the last acceleration; 19
of them in a row the control box puts up with. Before them, and again between two such rows, the acceleration may be
as high as it can: so each rise of a velocity leaves room for as many more of it as that takes.
"""

from dataclasses import replace

import numpy as np

from bridge.core.limiter import Limiter
from bridge.core.watchdog import Watchdog
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_XI, Limits

TICK_S = 0.001
# Targets that come in farther apart than this (s) are followed as if they had come so: the delay must stay small.
_LONGEST_SPAN = 0.02
# In a row; the next one stops the arm.
_LOST = 19
# Every joint's acceleration dies away in two periods, at half of it in the first: two rows of lost packets with one
# command in between are the worst there can be.
_REPEATS = 1.5 * _LOST
# Of the arm's limits: nobody knows how its control box rounds.
_SHARE = 0.999


class ArmFollower:
    """Follows joint velocities that come in slower than 1 kHz; holds on a deadline of its own.

    Between two targets it goes in a straight line for as long as they lay apart, so a stairway of targets becomes
    the slope that was meant. Times are on one monotonic clock (s).
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
        # After silence it begins where the fading has led, not at the target from before.
        self._start = self._watchdog.trust(at) * self._goal(at)
        self._span = min(max(at - self._began, TICK_S), _LONGEST_SPAN)
        self._target, self._began = target, at
        self._watchdog.feed(at)

    def step(self, now: float, q: Array, dq: Array, ddq: Array, hold: bool = False) -> Array:
        """Joint velocities for the next millisecond (7, rad/s).

        Args:
            now: Present time (s).
            q: Measured joint angles (7, rad).
            dq: Velocities that the arm took as commanded last (7, rad/s): after lost packets these are its own guess.
            ddq: Accelerations likewise (7, rad/s²).
            hold: Come to rest whatever the target is.
        """
        self._limiter.go_on_from(dq, ddq * TICK_S)
        self._desired[ARM_XI] = 0.0 if hold else self._watchdog.trust(now) * self._goal(now)
        return self._limiter.step(self._desired, q)[ARM_XI]

    def _goal(self, now: float) -> Array:
        fraction = min(1.0, (now - self._began) / self._span)
        return self._start + fraction * (self._target - self._start)
