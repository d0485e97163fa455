"""Limits of velocity, acceleration and jerk, and braking before joint limits."""

from dataclasses import dataclass

import numpy as np

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.compiled import FLAG, NOTHING, VECTOR, compiled
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

_SLACK = 1e-9


@dataclass(frozen=True)
class Saturated:
    """What may be sent.

    Attributes:
        xi: ξ̇ (9), within every limit.
        scale: Share of the wanted velocity that fits, 0…1; the motion's clock is slowed by it.
        braked: True if no scale is feasible and every actuator brakes at its maximum.
    """

    xi: Array
    scale: float
    braked: bool


class Saturation:
    """Makes a wanted velocity sendable by scaling it in time, never by bending it joint by joint."""

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float, base_dt: float | None = None) -> None:
        """Precompute the limits for a control period of `dt` (s).

        Args:
            robot: Whose limits they are.
            config: Section `[controller.whole_body]`.
            dt: Control period (s).
            base_dt: Period of the base (s), in which its speed may change by as much at once; None for `dt`.
        """
        self._dt = dt
        limits = robot.limits
        self._lower = limits.lower[ARM_Q] + config.joint_margin
        self._upper = limits.upper[ARM_Q] - config.joint_margin
        self.velocity = limits.velocity * config.arm_velocity_scale
        wheel = (config.base_speed + config.base_yaw_rate * robot.drive.half_track) / robot.drive.wheel_radius
        self.velocity[:2] = min(wheel, float(limits.velocity[0]))
        self.acceleration = limits.acceleration * config.arm_acceleration_scale
        base = config.base_acceleration / robot.drive.wheel_radius
        self.acceleration[:2] = min(base, float(limits.acceleration[0]))
        self._step = self.acceleration * dt
        # Rows that give v and φ̇ as fractions of their limits.
        twist = Actuation(robot.drive).twist
        self._base_shares = twist / np.array([[config.base_speed], [config.base_yaw_rate]])
        # Limits for braking, the largest that the final check allows.
        self._stop_step = self._step.copy()
        braking = min(config.base_braking / robot.drive.wheel_radius, float(limits.acceleration[0]))
        self._stop_step[:2] = np.maximum(braking * dt, self._step[:2])
        self._greatest_step = self._stop_step * np.where(np.arange(NXI) < 2, (base_dt or dt) / dt, 1.0)
        self._jerk_step = limits.jerk * dt * dt
        self._most, self._least = self.velocity, -self.velocity
        self._brake = 0.5 * self.acceleration[ARM_XI]
        self._brake_step = self._brake * dt

    def apply(self, wanted: Array, q: Array, sent: Array) -> Saturated:
        """The velocity to send.

        Args:
            wanted: ξ̇ (9) of the method.
            q: Configuration (12).
            sent: ξ̇ (9) sent last.
        """
        upper, lower = self._box(q)
        # The box holds zero, so that of each pair of quotients the positive one counts.
        base = self._base_shares @ wanted[:2]
        demanded = max(float((wanted / upper).max()), float((wanted / lower).max()), float(np.abs(base).max()))
        scale = 1.0 if demanded <= 1.0 else 1.0 / demanded
        aimed = wanted * scale
        change = aimed - sent
        largest = float((np.abs(change) / self._step).max())
        xi = aimed if largest <= 1.0 else sent + change / largest
        if (xi > upper + _SLACK).any() or (xi < lower - _SLACK).any():
            return Saturated(self.brake(sent), 0.0, True)
        # Rate of the motion's clock, limited by the reachable velocity.
        reached = 1.0 if largest <= 1.0 else _along(xi, wanted)
        return Saturated(xi, min(scale, reached), False)

    def admits(self, xi: Array, sent: Array) -> bool:
        """Whether a velocity (9) may follow the one sent last: finite, and inside velocity and acceleration."""
        return _admits(xi, sent, self.velocity, self._greatest_step)

    def smooth(self, xi: Array, sent: Array, before: Array) -> Array:
        """The velocity (9) nearest to `xi` that the arm's rated jerk lets follow.

        Args:
            xi: ξ̇ (9) within the acceleration of `sent`, so that the answer is as well.
            sent: ξ̇ (9) sent last.
            before: ξ̇ (9) sent in the period before that.
        """
        smoothed = np.empty(NXI)
        _smooth(xi, sent, before, self._jerk_step, smoothed)
        return smoothed

    def brake(self, sent: Array) -> Array:
        """The velocity (9) after one period of the greatest deceleration of every actuator."""
        slower: Array = np.sign(sent) * np.maximum(np.abs(sent) - self._stop_step, 0.0)
        return slower

    def ramp(self, sent: Array) -> Array:
        """The velocity (9) after one period of slowing down in proportion, which keeps the direction of motion."""
        largest = float((np.abs(sent) / self._stop_step).max())
        return np.zeros(NXI) if largest <= 1.0 else sent * (1.0 - 1.0 / largest)

    def _box(self, q: Array) -> tuple[Array, Array]:
        """Velocities from which every joint can still stop before its limit, also after one more period."""
        arm = q[ARM_Q]
        upper, lower = self._most.copy(), self._least.copy()
        # After one more period at this velocity, half of the deceleration suffices; the rest is for the servo's lag.
        a, a_dt = self._brake, self._brake_step
        above = np.sqrt(a_dt * a_dt + 2.0 * a * np.maximum(self._upper - arm, 0.0)) - a_dt
        below = np.sqrt(a_dt * a_dt + 2.0 * a * np.maximum(arm - self._lower, 0.0)) - a_dt
        upper[ARM_XI] = np.minimum(upper[ARM_XI], above) + _SLACK
        lower[ARM_XI] = np.maximum(lower[ARM_XI], -below) - _SLACK
        return upper, lower


def _along(xi: Array, wanted: Array) -> float:
    """Fraction of `wanted` that `xi` has in its direction, 0…1."""
    square = float(wanted @ wanted)
    return max(0.0, min(1.0, float(xi @ wanted) / square)) if square > 1e-12 else 1.0


@compiled(FLAG(VECTOR, VECTOR, VECTOR, VECTOR))
def _admits(xi: Array, sent: Array, velocity: Array, step: Array) -> bool:
    """Whether |ξ̇| ≤ velocity and |ξ̇ − ξ̇_sent| ≤ step, but for rounding (9 each)."""
    for i in range(len(xi)):
        # Comparisons with NaN are false, so that NaN is not admitted.
        if not abs(xi[i]) <= velocity[i] + 2 * _SLACK:
            return False
        if not abs(xi[i] - sent[i]) <= step[i] * (1 + 1e-9) + _SLACK:
            return False
    return True


@compiled(NOTHING(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR))
def _smooth(xi: Array, sent: Array, before: Array, step: Array, smoothed: Array) -> None:
    """Write ξ̇ with its change inside the last one ± step (9 each)."""
    for i in range(len(xi)):
        last = sent[i] - before[i]
        smoothed[i] = sent[i] + min(max(xi[i] - sent[i], last - step[i]), last + step[i])
