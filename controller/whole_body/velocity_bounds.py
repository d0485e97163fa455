"""Velocity bounds of every actuator for one period, feasible by construction.

A joint of the arm brakes at half of its acceleration a; the other half is for the servo's lag. With the distance r to
its limit and the period dt it may have the velocity q̇ for which q̇ dt + q̇²/a ≤ r, that is

q̇ ≤ −(a/2) dt + √(((a/2) dt)² + a r).

After one period at q̇ it can still stop. From a velocity inside this bound the next bound can be reached by braking at
a/2, so that the bounds are never empty.

The acceleration may change by j dt in a period, with the jerk j. So a joint approaches the bound above by the law of
`jerk_limit.py`, which needs no more than j dt. The bound itself falls by at most (a/2) dt in a period, which is added
to the change of the velocity.

Outside these guarantees (a start beyond a limit, a velocity above it) the bounds allow the strongest braking only.
"""

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from msgspec import Struct

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.compiled import NOTHING, NUMBER, PAIR, VECTOR, compiled, records
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.jerk_limit import largest_rise
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

#: Rate at which a joint outside its limit returns (1/s), and its largest velocity then (rad/s).
_RETURN, _RETURN_SPEED = 2.0, 0.2
#: Constant limits; SI, of the arm's joints (7), of v and φ̇ (2) or of a wheel.
_CONSTANTS = np.dtype(
    [
        ("highest", "f8", 7),
        ("lowest", "f8", 7),
        ("acceleration", "f8", 7),
        ("arm_step", "f8", 7),
        ("jerk_step", "f8", 7),
        ("arm_speed", "f8", 7),
        ("base_speed", "f8", 2),
        ("base_step", "f8", 2),
        ("base_brake", "f8", 2),
        ("wheel_speed", "f8"),
        ("wheel_step", "f8"),
        ("twist", "f8", (2, 2)),
    ]
)


class Bounds(Struct, frozen=True):
    """lower ≤ ν ≤ upper (9), and the same for the two wheels' speeds (2).

    `ramp` is [v, φ̇] (2) after one period of braking along the same arc, which is always inside.
    """

    lower: Array
    upper: Array
    wheel_lower: Array
    wheel_upper: Array
    ramp: Array


class VelocityBounds:
    """Computes the bounds from the configuration and the last command."""

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Precompute for a control period of `dt` (s)."""
        limits, mu, R = robot.limits, robot.drive.half_track, robot.drive.wheel_radius
        #: Largest ν (9).
        self.speed: Array = np.empty(NXI)
        self.speed[:2] = config.base_speed, config.base_yaw_rate
        self.speed[ARM_XI] = limits.velocity[ARM_XI] * config.arm_velocity_scale
        acceleration = limits.acceleration[ARM_XI] * config.arm_acceleration_scale
        braking = min(max(config.base_braking, config.base_acceleration), float(limits.acceleration[0]) * R)
        base_step = min(config.base_acceleration, braking) * dt, config.base_yaw_acceleration * dt
        base_brake = braking * dt, max(braking / mu, config.base_yaw_acceleration) * dt
        self._arm_step = acceleration * dt
        self._wheel_step = braking / R * dt
        self._jerk_most = limits.jerk[ARM_XI] * dt * dt
        self._constants: Any = np.zeros(1, _CONSTANTS)
        k = self._constants[0]
        k["highest"] = limits.upper[ARM_Q] - config.joint_margin
        k["lowest"] = limits.lower[ARM_Q] + config.joint_margin
        k["acceleration"], k["arm_step"], k["arm_speed"] = acceleration, self._arm_step, self.speed[ARM_XI]
        k["jerk_step"] = limits.jerk[ARM_XI] * config.arm_jerk_scale * dt * dt
        k["base_speed"], k["base_step"], k["base_brake"] = self.speed[:2], base_step, base_brake
        self._wheel_speed, self._radius = float(limits.velocity[0]), R
        k["wheel_speed"], k["wheel_step"] = self._wheel_speed, self._wheel_step
        k["twist"] = Actuation(robot.drive).twist

    def at(self, q: Array, sent: Array, before: Array, wheel_cap: float = math.inf) -> Bounds:
        """The bounds at q (12) after ξ̇ `sent` (9), and `before` (9) in the period before that.

        No wheel turns faster than `wheel_cap` (m/s on the ground), or brakes until it is so.
        """
        self._constants[0]["wheel_speed"] = min(self._wheel_speed, wheel_cap / self._radius)
        lower, upper = np.empty(NXI), np.empty(NXI)
        wheel_lower, wheel_upper, ramp = np.empty(2), np.empty(2), np.empty(2)
        _bounds(self._constants, q, sent, before, lower, upper, wheel_lower, wheel_upper, ramp)
        return Bounds(lower, upper, wheel_lower, wheel_upper, ramp)

    def brake(self, sent: Array, before: Array) -> Array:
        """ξ̇ (9) after one period of the strongest braking of every actuator, at the arm's rated jerk."""
        out = np.empty(NXI)
        out[:2] = _ramp(float(sent[0]), float(sent[1]), self._wheel_step)
        arm, most, step = sent[ARM_XI], self._jerk_most, self._arm_step
        last = np.minimum(np.maximum(arm - before[ARM_XI], -step), step)
        change = np.sign(arm) * np.maximum(np.abs(arm) - step, 0.0) - arm
        out[ARM_XI] = arm + np.minimum(np.maximum(change, last - most), last + most)
        return out


@compiled(PAIR(NUMBER, NUMBER, NUMBER))
def _ramp(left: float, right: float, step: float) -> tuple[float, float]:
    """Wheel speeds after one period of braking along the same arc, each by no more than `step`."""
    largest = max(abs(left), abs(right)) / step
    if largest <= 1.0:
        return 0.0, 0.0
    return left * (1.0 - 1.0 / largest), right * (1.0 - 1.0 / largest)


#: The same function for scalars.
_largest_rise: Callable[[float, float, float], float] = compiled(NUMBER(NUMBER, NUMBER, NUMBER))(
    cast(Any, largest_rise)
)


@compiled(NUMBER(NUMBER, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER))
def _most(
    room: float, sent: float, before: float, step: float, jerk: float, acceleration: float, speed: float
) -> float:
    """The largest velocity of a joint with `room` to its upper limit; see the head of this file."""
    brake = 0.5 * step
    change = max(-step, min(step, sent - before))
    if room < 0.0:
        most = max(_RETURN * room, -_RETURN_SPEED)
    else:
        most = math.sqrt(brake * brake + acceleration * room) - brake
    rise = min(_largest_rise(most - sent + brake, jerk, 0.0) - brake, _largest_rise(speed - sent, jerk, 0.0))
    # Each bound is clipped to the reachable range, which keeps their order.
    rise = min(rise, min(step, change + jerk))
    return sent + max(rise, max(-step, change - jerk))


@compiled(PAIR(NUMBER, NUMBER, NUMBER, NUMBER))
def _wheel(sent: float, step: float, most: float, ramp: float) -> tuple[float, float]:
    """Bounds of a wheel's speed."""
    return min(max(-most, sent - step), ramp), max(min(most, sent + step), ramp)


@compiled(PAIR(NUMBER, NUMBER, NUMBER, NUMBER, NUMBER))
def _base(sent: float, step: float, brake: float, most: float, ramp: float) -> tuple[float, float]:
    """Bounds of v or φ̇: braking may be stronger than speeding up, but not beyond standstill."""
    low, high = sent - step, sent + step
    if sent > 0.0:
        low = min(low, max(0.0, sent - brake))
    else:
        high = max(high, min(0.0, sent + brake))
    return min(max(-most, low), ramp), max(min(most, high), ramp)


@compiled(NOTHING(records(_CONSTANTS), VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR))
def _bounds(
    constants: Any,
    q: Array,
    sent: Array,
    before: Array,
    lower: Array,
    upper: Array,
    wheel_lower: Array,
    wheel_upper: Array,
    ramp: Array,
) -> None:
    """Write the bounds; see `Bounds`."""
    k = constants[0]
    for i in range(7):
        at, now, last = q[5 + i], sent[2 + i], before[2 + i]
        step, jerk, a, speed = k.arm_step[i], k.jerk_step[i], k.acceleration[i], k.arm_speed[i]
        upper[2 + i] = _most(k.highest[i] - at, now, last, step, jerk, a, speed)
        # The lower end is the upper end of the joint's mirror image. Only a state far outside every bound can make the
        # two contradict each other.
        lower[2 + i] = min(-_most(at - k.lowest[i], -now, -last, step, jerk, a, speed), upper[2 + i])
    slower = _ramp(sent[0], sent[1], k.wheel_step)
    for i in range(2):
        wheel_lower[i], wheel_upper[i] = _wheel(sent[i], k.wheel_step, k.wheel_speed, slower[i])
        moves = k.twist[i, 0] * sent[0] + k.twist[i, 1] * sent[1]
        ramp[i] = k.twist[i, 0] * slower[0] + k.twist[i, 1] * slower[1]
        lower[i], upper[i] = _base(moves, k.base_step[i], k.base_brake[i], k.base_speed[i], ramp[i])
