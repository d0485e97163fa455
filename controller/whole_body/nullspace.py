"""Method `nullspace`: the paper's eq. 12, corrected.

ξ̇ = J_W⁺ (ẋ_d + K e) + (I − J_W⁺ J) (c1 + c2 + posture)

with a damped pseudo-inverse weighted by W = diag(1/v_max²). The weights of the two wheels are expressed in the base's
forward speed and yaw rate, so that turning, which moves a tool beside the base fastest, is not preferred to driving.
Our additions to the paper are the posture velocity in the null space (base parallel to the row at the planned place
along it, and the arm towards the planned posture) and the limits: the answer is scaled in time until it fits. It knows
neither collisions nor a tool with a free axis.
"""

import math

import numpy as np
from scipy.linalg.lapack import dposv

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.joint_limits import LimitRepulsion
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import NOT_FINITE, ActuatorTask, IkProblem, Solution
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel


class Nullspace:
    """One damped weighted pseudo-inverse, secondary velocities in its null space."""

    name = "nullspace"
    flows = True

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Precompute the weights and the limits for a control period of `dt` (s)."""
        self._config = config
        self._saturation = Saturation(robot, config, dt)
        self._wheels = Actuation(robot.drive).wheels
        self._manipulability = ArmManipulability()
        self._repulsion = LimitRepulsion(robot.limits, config.gain_limits, config.limit_zone)
        rated = np.array([config.base_speed, config.base_yaw_rate]) ** 2
        self._inverse_weight = np.zeros((NXI, NXI))
        self._inverse_weight[:2, :2] = self._wheels @ np.diag(rated) @ self._wheels.T
        arm = (robot.limits.velocity[ARM_XI] * config.arm_velocity_scale) ** 2
        self._inverse_weight[ARM_XI, ARM_XI] = np.diag(arm)
        self._frozen_weight = self._inverse_weight.copy()
        self._frozen_weight[:2] = 0.0
        self._damping = np.eye(6) * config.damping**2

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        if not problem.finite:
            return self._brake(problem, NOT_FINITE, 0.0)
        manipulability = self._manipulability.at(problem.kinematics.J)
        wanted = self._wanted(problem, manipulability.gradient)
        if wanted is None:
            return self._brake(problem, NOT_FINITE, manipulability.value)
        linear = problem.kinematics.J_xi[:3] @ wanted
        speed = math.sqrt(float(linear @ linear))
        speed_scale = max(problem.speed_cap, 0.0) / speed if speed > problem.speed_cap else 1.0
        limited = self._saturation.apply(wanted * speed_scale, problem.q, problem.sent)
        reason = "a limit of a joint or wheel" if limited.braked else ""
        return Solution(limited.xi, limited.scale * speed_scale, manipulability.value, not limited.braked, reason)

    def _wanted(self, problem: IkProblem, gradient: Array) -> Array | None:
        """ξ̇ (9) before any limit; None where the equations have no finite answer."""
        if isinstance(problem.tool, ActuatorTask):
            return problem.tool.xi
        config, J = self._config, problem.kinematics.J_xi
        frozen = problem.base == "frozen"
        W_inv = self._frozen_weight if frozen else self._inverse_weight
        secondary = self._repulsion.at(problem.q)
        secondary += config.gain_manipulability * gradient
        secondary += self._posture(problem)
        if frozen:
            secondary[:2] = 0.0
        WJt = W_inv @ J.T
        # J⁺b + (I − J⁺J)z = z + J⁺(b − J z): one factorisation, no projector.
        _, multiplier, info = dposv(J @ WJt + self._damping, problem.tool.twist - J @ secondary)
        if info != 0 or not math.isfinite(float(multiplier.sum())):
            return None
        wanted: Array = secondary + WJt @ multiplier
        return wanted

    def _posture(self, problem: IkProblem) -> Array:
        """Velocity over ξ (9) towards the posture: base along its heading and parallel to it, arm joints to theirs."""
        config, q, reference, rate = self._config, problem.q, problem.posture.q, problem.posture.rate
        out = np.empty(NXI)
        c, s = math.cos(reference[2]), math.sin(reference[2])
        speed = 0.0
        if problem.base == "row":
            along = c * (reference[0] - q[0]) + s * (reference[1] - q[1])
            speed = config.gain_posture * along + c * rate[0] + s * rate[1]
            speed = max(-config.base_speed, min(config.base_speed, speed))
        turn = 0.0 if problem.base == "transit" else config.gain_heading * math.sin(reference[2] - q[2])
        turn = max(-config.base_yaw_rate, min(config.base_yaw_rate, turn))
        out[:2] = self._wheels @ (speed, turn)
        out[ARM_XI] = config.gain_posture * (reference[ARM_Q] - q[ARM_Q]) + rate[ARM_Q]
        return out

    def _brake(self, problem: IkProblem, reason: str, manipulability: float) -> Solution:
        sent = problem.sent if math.isfinite(float(problem.sent.sum())) else np.zeros(NXI)
        return Solution(self._saturation.brake(sent), 0.0, manipulability, False, reason)
