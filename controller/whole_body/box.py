"""The first level of the hierarchy: bounds of every actuator for one period, feasible by construction.

An arm joint with the distance d to its limit, the braking deceleration a and the period dt may have the velocity v for
which v dt + v²/2a ≤ d, that is v ≤ −a dt + √((a dt)² + 2 a d): after one period at v it can still stop. From a velocity
inside this bound the next bound is within reach by braking at a, so that the bounds never empty. Half of the joint's
acceleration is reckoned with for this; the rest is for the servo's lag.

The acceleration may change by j dt in a period. So a joint comes to the bound above as `jerk_limit.py` says, which in
turn never asks for more than j dt: the bound falls by no more than b dt in a period, so that against it the velocity
rises by what it changes by plus b dt.

Outside every such guarantee (a start beyond a limit, a velocity above it) the bounds close to the strongest braking.
"""

import numpy as np
from msgspec import Struct

from controller.config import ControllerConfig
from controller.whole_body.actuation import Actuation
from rolling_panda.differential_drive import NXI, Array
from rolling_panda.jerk_limit import largest_rise
from rolling_panda.robot_model import ARM_Q, ARM_XI, RobotModel

#: Rate at which a joint outside its limit comes back (1/s), and its largest velocity in doing so (rad/s).
_RETURN, _RETURN_SPEED = 2.0, 0.2


class Bounds(Struct, frozen=True):
    """lower ≤ ν ≤ upper (9), and the same for the two wheels' speeds (2)."""

    lower: Array
    upper: Array
    wheel_lower: Array
    wheel_upper: Array


class Box:
    """Makes the bounds from where the robot is and what was sent last."""

    def __init__(self, robot: RobotModel, config: ControllerConfig, dt: float) -> None:
        """Precompute for a control period of `dt` (s)."""
        limits, mu, R = robot.limits, robot.drive.half_track, robot.drive.wheel_radius
        self._twist: list[list[float]] = Actuation(robot.drive).twist.tolist()
        # Both ends of a joint as upper ends: of q, and of −q.
        self._ends = np.concatenate([limits.upper[ARM_Q], -limits.lower[ARM_Q]]) - config.joint_margin
        acceleration = np.tile(limits.acceleration[ARM_XI] * config.arm_acceleration_share, 2)
        self._arm_step = acceleration * dt
        self._brake_step = 0.5 * self._arm_step
        self._brake_square, self._brake_twice = self._brake_step**2, acceleration
        self._jerk_step = np.tile(limits.jerk[ARM_XI] * config.arm_jerk_share, 2) * dt * dt
        self._jerk_most = limits.jerk[ARM_XI] * dt * dt
        self._q, self._sent, self._change = np.empty(14), np.empty(14), np.empty(14)
        #: Largest ν (9).
        self.speed: Array = np.empty(NXI)
        self.speed[:2] = config.base_speed, config.base_yaw_rate
        self.speed[ARM_XI] = limits.velocity[ARM_XI] * config.arm_share
        self._arm_speed = np.tile(self.speed[ARM_XI], 2)
        self._wheel_speed = float(limits.velocity[0])
        braking = min(max(config.base_braking, config.base_acceleration), float(limits.acceleration[0]) * R)
        self._wheel_step = braking / R * dt
        self._base_step = min(config.base_acceleration, braking) * dt, config.base_yaw_acceleration * dt
        self._base_brake = braking * dt, max(braking / mu, config.base_yaw_acceleration) * dt

    def at(self, q: Array, sent: Array, before: Array) -> Bounds:
        """The bounds at q (12) after ξ̇ `sent` (9), and `before` (9) in the period before that."""
        here, arm, change = self._q, self._sent, self._change
        here[:7] = q[ARM_Q]
        here[7:] = -here[:7]
        arm[:7] = sent[ARM_XI]
        arm[7:] = -arm[:7]
        np.subtract(arm[:7], before[ARM_XI], out=change[:7])
        change[7:] = -change[:7]
        np.minimum(np.maximum(change, -self._arm_step, out=change), self._arm_step, out=change)
        room = self._ends - here
        most = np.sqrt(self._brake_square + self._brake_twice * np.maximum(room, 0.0)) - self._brake_step
        if min(room.tolist()) < 0.0:
            most = np.minimum(most, np.where(room < 0.0, np.maximum(_RETURN * room, -_RETURN_SPEED), np.inf))
        jerk, brake = self._jerk_step, self._brake_step
        rise = np.minimum(largest_rise(most - arm + brake, jerk) - brake, largest_rise(self._arm_speed - arm, jerk))
        # Every end is moved into what can be reached, which keeps their order.
        rise = np.minimum(rise, np.minimum(self._arm_step, change + jerk))
        most = arm + np.maximum(rise, np.maximum(-self._arm_step, change - jerk))
        lower, upper = np.empty(NXI), np.empty(NXI)
        upper[ARM_XI] = most[:7]
        # Only a state far outside every bound can make the ends contradict each other.
        lower[ARM_XI] = np.minimum(-most[7:], most[:7])
        left, right = float(sent[0]), float(sent[1])
        slower_left, slower_right = self.ramp(left, right)
        low, high = zip(self._wheel(left, slower_left), self._wheel(right, slower_right), strict=True)
        (half, _), (_, turn) = self._twist
        v, omega = half * (left + right), turn * (right - left)
        lower[0], upper[0] = self._base(0, v, half * (slower_left + slower_right))
        lower[1], upper[1] = self._base(1, omega, turn * (slower_right - slower_left))
        return Bounds(lower, upper, np.array(low), np.array(high))

    def ramp(self, left: float, right: float) -> tuple[float, float]:
        """Wheel speeds after one period of braking along the same arc: what is always possible."""
        largest = max(abs(left), abs(right)) / self._wheel_step
        if largest <= 1.0:
            return 0.0, 0.0
        return left * (1.0 - 1.0 / largest), right * (1.0 - 1.0 / largest)

    def brake(self, sent: Array, before: Array) -> Array:
        """ξ̇ (9) after one period of the strongest braking of every actuator, at the arm's rated jerk."""
        out = np.empty(NXI)
        out[:2] = self.ramp(float(sent[0]), float(sent[1]))
        arm, most, step = sent[ARM_XI], self._jerk_most, self._arm_step[:7]
        last = np.minimum(np.maximum(arm - before[ARM_XI], -step), step)
        change = np.sign(arm) * np.maximum(np.abs(arm) - step, 0.0) - arm
        out[ARM_XI] = arm + np.minimum(np.maximum(change, last - most), last + most)
        return out

    def _wheel(self, sent: float, ramp: float) -> tuple[float, float]:
        low = max(-self._wheel_speed, sent - self._wheel_step)
        high = min(self._wheel_speed, sent + self._wheel_step)
        return min(low, ramp), max(high, ramp)

    def _base(self, i: int, sent: float, ramp: float) -> tuple[float, float]:
        """Bounds of v (i = 0) or ω (1): braking may be stronger than speeding up, but not beyond standstill."""
        step, brake, most = self._base_step[i], self._base_brake[i], float(self.speed[i])
        low, high = sent - step, sent + step
        if sent > 0.0:
            low = min(low, max(0.0, sent - brake))
        else:
            high = max(high, min(0.0, sent + brake))
        return min(max(-most, low), ramp), max(min(most, high), ramp)
