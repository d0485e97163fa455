"""Dynamics over the actuated coordinates: the paper's eqs. 9 and 10, corrected (docs/paper.md).

M_ξ ξ̈ + V_ξ ξ̇ + G_ξ = u + Sᵀ τ_dis with M_ξ = Sᵀ M S, V_ξ = Sᵀ (M Ṡ + V S), G_ξ = Sᵀ G

where M, V and G are Pinocchio's over q (12×12, 12×12, 12), and S eliminates the forces that keep the wheels rolling.
Units over ξ: Nm for every actuator. Gravity is 9.81 m/s², masses are the URDFs'.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg import cho_factor, cho_solve

from rolling_panda.model.differential_drive import NQ, Array
from rolling_panda.model.robot import RobotModel


@dataclass(frozen=True)
class Terms:
    """The equation of motion at one state.

    Attributes:
        M: M_ξ (9×9), symmetric and positive definite.
        V: V_ξ (9×9), with which Ṁ_ξ − 2 V_ξ is skew-symmetric.
        G: G_ξ (9); its wheel entries are zero on flat ground.
    """

    M: Array
    V: Array
    G: Array


class Dynamics:
    """Forward and inverse dynamics. Not thread-safe: it uses the work space of its `RobotModel`."""

    def __init__(self, robot: RobotModel) -> None:
        """Remember the robot."""
        self._robot = robot

    def terms(self, q: Array, xi: Array) -> Terms:
        """M_ξ, V_ξ and G_ξ at q (12) and ξ̇ (9)."""
        model, data = self._robot.model, self._robot.data
        S = self._robot.drive.basis(float(q[2]))
        v = S @ xi
        M = pin.crba(model, data, q)
        # Pinocchio promises the upper triangle only.
        M = np.triu(M) + np.triu(M, 1).T
        V = pin.computeCoriolisMatrix(model, data, q, v)
        G = pin.computeGeneralizedGravity(model, data, q)
        return Terms(S.T @ M @ S, S.T @ (M @ basis_rate(S, v) + V @ S), S.T @ G)

    def forward(self, q: Array, xi: Array, u: Array, disturbance: Array | None = None) -> Array:
        """Acceleration ξ̈ (9).

        Args:
            q: Configuration (12).
            xi: ξ̇ (9).
            u: Torques of the actuators (9, Nm).
            disturbance: τ_dis, generalised forces over q (12), such as Jᵀ times a force at the tool.
        """
        terms = self.terms(q, xi)
        torque = u - terms.V @ xi - terms.G
        if disturbance is not None:
            torque = torque + self._robot.drive.basis(float(q[2])).T @ disturbance
        acceleration: Array = cho_solve(cho_factor(terms.M), torque)
        return acceleration

    def inverse(self, q: Array, xi: Array, acceleration: Array) -> Array:
        """Torques of the actuators u (9, Nm) that give this ξ̈ (9); without forming the matrices."""
        S = self._robot.drive.basis(float(q[2]))
        v = S @ xi
        a = acceleration_of_q(S, v, acceleration)
        torque: Array = S.T @ pin.rnea(self._robot.model, self._robot.data, q, v, a)
        return torque

    def energy(self, q: Array, xi: Array) -> float:
        """Kinetic and potential energy (J); the potential is zero on the ground."""
        model, data = self._robot.model, self._robot.data
        v = self._robot.drive.basis(float(q[2])) @ xi
        return float(pin.computeKineticEnergy(model, data, q, v) + pin.computePotentialEnergy(model, data, q))


def basis_rate(S: Array, v: Array) -> Array:
    """Ṡ (12×9) from S and q̇ (12): the base's forward direction turns with it."""
    rate = np.zeros((NQ, S.shape[1]))
    rate[0], rate[1] = -v[2] * S[1], v[2] * S[0]
    return rate


def acceleration_of_q(S: Array, v: Array, acceleration: Array) -> Array:
    """Acceleration q̈ = S ξ̈ + Ṡ ξ̇ (12), where Ṡ ξ̇ is the base's centripetal acceleration, from S, q̇ (12) and ξ̈ (9)."""
    a: Array = S @ acceleration
    a[0] -= v[2] * v[1]
    a[1] += v[2] * v[0]
    return a
