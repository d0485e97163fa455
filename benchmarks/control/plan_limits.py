"""Limits of planned motions: rates of base and arm, joint margins and clearance."""

from dataclasses import dataclass

import numpy as np

from controller.motion.rest_to_rest import Rates
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel


@dataclass(frozen=True)
class PlanLimits:
    """Bounds of planned motions.

    Attributes:
        drive: Of the base along its path (m).
        turn: Of its heading (rad).
        arm_velocity: Of each arm joint (7, rad/s).
        arm_acceleration: The same (7, rad/s²).
        arm_jerk: The same (7, rad/s³).
        lower: Least arm joint positions that a plan uses (7, rad).
        upper: Greatest ones (7, rad).
        clearance: Distance kept between the robot's parts, from the ground and from obstacles (m).
        dt: Control period (s).
    """

    drive: Rates
    turn: Rates
    arm_velocity: Array
    arm_acceleration: Array
    arm_jerk: Array
    lower: Array
    upper: Array
    clearance: float = 0.02
    dt: float = 0.01

    def arm_rates(self, span: Array) -> Rates:
        """Limits of the progress 0…1 of a straight joint motion over `span` (7, rad) that keep all joint limits."""
        size = np.maximum(np.abs(span), 1e-9)
        return Rates(
            float((self.arm_velocity / size).min()),
            float((self.arm_acceleration / size).min()),
            float((self.arm_jerk / size).min()),
        )


def plan_limits(
    robot: RobotModel,
    base_speed: float,
    base_yaw_rate: float,
    base_acceleration: float = 0.8,
    arm_velocity_scale: float = 0.9,
    arm_acceleration_scale: float = 0.5,
    joint_margin: float = 0.03,
    dt: float = 0.01,
    clearance: float = 0.02,
) -> PlanLimits:
    """Limits for planning, below the robot's own limits to leave margin for feedback.

    Args:
        robot: The robot model.
        base_speed: Speed of the base (m/s).
        base_yaw_rate: Yaw rate of the base (rad/s).
        base_acceleration: Acceleration of the base (m/s²). With the arm stretched forward the base tips at about 0.7 to
            1.7 m/s².
        arm_velocity_scale: Fraction of the arm's rated velocities.
        arm_acceleration_scale: Fraction of its rated accelerations.
        joint_margin: Distance kept from every joint limit (rad).
        dt: Control period (s).
        clearance: Distance kept between the robot's parts, from the ground and from obstacles (m).
    """
    return PlanLimits(
        drive=Rates(0.95 * base_speed, base_acceleration, 4.0),
        turn=Rates(0.95 * base_yaw_rate, 1.2, 6.0),
        arm_velocity=robot.limits.velocity[ARM_XI] * arm_velocity_scale,
        arm_acceleration=robot.limits.acceleration[ARM_XI] * arm_acceleration_scale,
        # A fiftieth: the acceleration rises within a tenth of a second, which shakes nothing.
        arm_jerk=0.02 * robot.limits.jerk[ARM_XI],
        lower=robot.limits.lower[ARM_Q] + joint_margin,
        upper=robot.limits.upper[ARM_Q] - joint_margin,
        clearance=clearance,
        dt=dt,
    )
