"""The last steps before the actuators, for any input: limits, and the watchdog that fades to rest in silence.

Limits: velocity, acceleration, jerk and joint position.
"""

import numpy as np

from rolling_panda.model.differential_drive import Array
from rolling_panda.model.jerk_limit import largest_rise
from rolling_panda.model.robot import ARM_Q, ARM_XI, Limits

# Fraction of the acceleration that is assumed for braking before a joint's limit, because the servos lag.
_BRAKING = 0.5


class Limiter:
    """Follows a desired ξ̇ within the limits, starting from the previous setpoint. The first one is zero."""

    def __init__(
        self, limits: Limits, wheel_acceleration: float, joint_margin: float, dt: float, repeats: float = 0.0
    ) -> None:
        """Prepare.

        Args:
            limits: Of the robot.
            wheel_acceleration: Tighter bound for the wheels (rad/s²).
            joint_margin: Distance to an arm joint's limit at which motion towards it has ended (rad).
            dt: Period of `step` (s).
            repeats: Periods in which the arm may go on with its last acceleration against our will, as it does where
                packets are lost: so much room is left up to its joints' velocities.
        """
        self._repeats = repeats
        self._velocity, self._dt = limits.velocity, dt
        acceleration = limits.acceleration.copy()
        acceleration[:2] = np.minimum(acceleration[:2], wheel_acceleration)
        self._change = acceleration * dt
        self._lower = limits.lower[ARM_Q] + joint_margin
        self._upper = limits.upper[ARM_Q] - joint_margin
        self._braking = 2 * _BRAKING * acceleration[ARM_XI]
        self._arm_change = self._change[ARM_XI]
        self._jerk = limits.jerk[ARM_XI] * dt * dt
        self._last = np.zeros_like(self._jerk)
        self.sent = np.zeros_like(self._velocity)

    def restart(self, velocity: Array) -> None:
        """The robot moves like this now (9, rad/s), whatever was sent before."""
        self.sent = np.minimum(np.maximum(velocity, -self._velocity), self._velocity)
        self._last = np.zeros_like(self._last)

    def braking_s(self, velocity: Array) -> float:
        """Time to brake to rest from a velocity (9, rad/s) (s), without the arm's jerk limit."""
        return float((np.abs(velocity) / self._change).max()) * self._dt

    def go_on_from(self, velocity: Array, change: Array) -> None:
        """The arm took this as its last velocity (7, rad/s) and change in a period, whatever was sent."""
        self.sent[ARM_XI] = velocity
        self._last = change

    def step(self, desired: Array, arm: Array) -> Array:
        """Compute the next setpoint.

        Towards a limit a joint's velocity is bounded so that half its acceleration can stop it. Beyond the limit it may
        only return. If that needs more braking than possible, the joint brakes at its maximum. A joint
        reaches its target velocity with zero acceleration, in as many periods as its jerk limit needs.

        Args:
            desired: Desired ξ̇ (9, rad/s), finite.
            arm: Measured joint angles (7, rad).

        Returns:
            ξ̇ to send (9, rad/s), also in `sent`.
        """
        # np.clip costs four times as much, a thousand times a second.
        goal = np.minimum(np.maximum(desired, -self._velocity), self._velocity)
        towards_upper = np.sqrt(self._braking * np.maximum(self._upper - arm, 0.0))
        towards_lower = -np.sqrt(self._braking * np.maximum(arm - self._lower, 0.0))
        goal[ARM_XI] = np.minimum(np.maximum(goal[ARM_XI], towards_lower), towards_upper)
        missing = goal - self.sent
        change = np.minimum(np.maximum(missing, -self._change), self._change)
        arm_missing, jerk, last = missing[ARM_XI], self._jerk, self._last
        wanted = np.copysign(largest_rise(np.abs(arm_missing), jerk), arm_missing)
        if self._repeats > 0.0:
            sent, most = self.sent[ARM_XI], self._velocity[ARM_XI]
            up = largest_rise(most - sent, jerk, self._repeats)
            wanted = np.minimum(np.maximum(wanted, -largest_rise(most + sent, jerk, self._repeats)), up)
        wanted = np.minimum(np.maximum(wanted, last - jerk), last + jerk)
        self._last = np.minimum(np.maximum(wanted, -self._arm_change), self._arm_change)
        change[ARM_XI] = self._last
        self.sent = self.sent + change
        return self.sent


#: Earliest start of fading (s): two control periods. Earlier, no setpoint would be followed.
_ALWAYS_S = 0.02


class Watchdog:
    """A setpoint is followed for `fade_s`, then fades linearly to zero at `deadline_s`, where the watchdog trips.

    Fading before the deadline lets a heavy base brake smoothly and in time. A gap shorter than `fade_s` changes
    nothing, unless braking from that setpoint takes longer than the time left to the deadline. Then fading begins
    earlier.
    """

    def __init__(self, fade_s: float, deadline_s: float) -> None:
        """Start tripped: nothing has been commanded yet."""
        self._fade, self._deadline = min(fade_s, deadline_s), deadline_s
        self._fed, self._begins = float("-inf"), self._fade

    def feed(self, now: float, braking_s: float = 0.0) -> None:
        """A valid setpoint came at `now` (s), from which coming to rest takes `braking_s`."""
        self._fed = max(self._fed, now)
        self._begins = min(self._fade, max(self._deadline - braking_s, _ALWAYS_S))

    def tripped(self, now: float) -> bool:
        """No valid setpoint for the deadline."""
        return now - self._fed >= self._deadline

    def trust(self, now: float) -> float:
        """Share of the last setpoint to follow, 1 to 0."""
        silence = now - self._fed
        if silence <= self._begins:
            return 1.0
        if silence >= self._deadline:
            return 0.0
        return (self._deadline - silence) / (self._deadline - self._begins)
