"""Method `nullspace`: the paper's eq. 12, corrected.

ξ̇ = J_W⁺ (ẋ_d + K e) + (I − J_W⁺ J) (c1 + c2 + posture)

with a damped pseudo-inverse weighted by W = diag(1/v_max²). The weights of the two wheels are expressed in the base's
forward speed and yaw rate, so that turning, which moves a tool beside the base fastest, is not preferred to driving.
Our addition to the paper is the posture velocity in the null space: base parallel to the row at the planned place
along it, and the arm towards the planned posture.
"""

import math

import numpy as np
from scipy.linalg.lapack import dposv

from controller.config import ControllerConfig
from controller.whole_body.joint_limits import LimitRepulsion
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.task import Demand, Solution
from rolling_panda.differential_drive import NXI
from rolling_panda.errors import ControlError
from rolling_panda.robot_model import ARM_XI, RobotModel


class Nullspace:
    """One damped weighted pseudo-inverse, secondary velocities in its null space."""

    name = "nullspace"

    def __init__(self, robot: RobotModel, config: ControllerConfig) -> None:
        """Precompute the weights."""
        self._config = config
        self._manipulability = ArmManipulability()
        self._repulsion = LimitRepulsion(robot.limits, config.gain_limits, config.limit_zone)
        R, mu = robot.drive.wheel_radius, robot.drive.half_track
        # Columns: wheel speeds for unit forward speed and unit yaw rate.
        wheels = np.array([[1.0 / R, -mu / R], [1.0 / R, mu / R]])
        rated = np.array([config.base_speed, config.base_yaw_rate]) ** 2
        self._inverse_weight = np.zeros((NXI, NXI))
        self._inverse_weight[:2, :2] = wheels @ np.diag(rated) @ wheels.T
        arm = (robot.limits.velocity[ARM_XI] * config.arm_share) ** 2
        self._inverse_weight[ARM_XI, ARM_XI] = np.diag(arm)
        self._frozen_weight = self._inverse_weight.copy()
        self._frozen_weight[:2] = 0.0
        self._damping = np.eye(6) * config.damping**2

    def solve(self, demand: Demand) -> Solution:
        """The velocities that answer the demand; not yet limited.

        Args:
            demand: Tool task, posture and configuration.
        """
        config, J = self._config, demand.tool.jacobian
        W_inv = self._frozen_weight if demand.base_frozen else self._inverse_weight
        manipulability = self._manipulability.at(demand.kinematics.J)
        secondary = self._repulsion.at(demand.q)
        secondary += config.gain_manipulability * manipulability.gradient
        secondary += demand.posture
        if demand.base_frozen:
            secondary[:2] = 0.0
        WJt = W_inv @ J.T
        # J⁺b + (I − J⁺J)z = z + J⁺(b − J z): one factorisation, no projector.
        residual = demand.tool.target - J @ secondary
        _, multiplier, info = dposv(J @ WJt + self._damping, residual)
        if info != 0 or not math.isfinite(float(multiplier.sum())):
            raise ControlError(f"the velocity of the {demand.tool.name} has no finite answer")
        return Solution(secondary + WJt @ multiplier, manipulability.value)
