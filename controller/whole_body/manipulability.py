"""Manipulability of the arm, ω = √det(J Jᵀ), and its gradient: the paper's constraint task 1 (eqs. 15 and 16).

Of the ARM, as the paper's text says: the whole robot's Jacobian, which its formula prints, hides arm singularities.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from rolling_panda.differential_drive import NXI, Array
from rolling_panda.robot_model import ARM_Q, ARM_XI, RobotModel

_REGULAR = 1e-9
_THREE = np.ones(3)
_ONES, _NONE = np.ones((7, 7)), np.zeros((7, 7))
#: [j, i] is 1 where j ≥ i, j > i and (in the right half) j < i: summing columns j for each i.
_SUMS = np.block([[np.tril(_ONES), _NONE], [np.tril(_ONES, -1), _NONE], [_NONE, np.triu(_ONES, 1)]])


@dataclass(frozen=True)
class Manipulability:
    """ω of the arm, and its gradient over ξ (9), whose wheel entries are exactly zero."""

    value: float
    gradient: Array


class ArmManipulability:
    """Computes ω and its gradient from the joints' axes, which the Jacobian's columns hold."""

    def __init__(self) -> None:
        """Make the work space."""
        self._a, self._b = np.empty((5, 21)), np.empty((5, 21))

    def at(self, J: Array) -> Manipulability:
        """ω and gradient from the tool's Jacobian J (6×12) of the current configuration.

        ∂ω/∂q_i = ω tr(J⁺ ∂J/∂q_i). The derivative of a revolute geometric Jacobian is written out here: with v_j, ω_j
        the columns, ∂v_j/∂q_i = ω_i × v_j for i ≤ j and ω_j × v_i for i > j; ∂ω_j/∂q_i = ω_i × ω_j for i < j, else 0.
        """
        arm = J[:, ARM_Q]
        gradient = np.zeros(NXI)
        # One Cholesky factorisation gives ω as the product of its diagonal, and (J⁺)ᵀ = (J Jᵀ)⁻¹ J.
        factor, pinv_T, info = dposv(arm @ arm.T, arm)
        value = math.prod(factor.diagonal().tolist()) if info == 0 else 0.0
        if value <= _REGULAR:
            return Manipulability(0.0, gradient)
        # tr(J⁺ ∂_iJ) = Σ_j g_j · ∂_i v_j + h_j · ∂_i ω_j with (g, h) the columns of (J⁺)ᵀ.
        v, w = arm[:3], arm[3:]
        a, b = self._a, self._b
        a[:3, :7], a[:3, 7:14], a[:3, 14:] = v, w, pinv_T[:3]
        b[:3, :7], b[:3, 7:14], b[:3, 14:] = pinv_T[:3], pinv_T[3:], w
        # With the first two rows repeated below the third, a cross product is two products of shifted rows.
        a[3:], b[3:] = a[:2], b[:2]
        crossed = a[1:4] * b[2:5] - a[2:5] * b[1:4]
        # Σ_{j ≥ i} (ω_i × v_j)·g_j = ω_i · Σ_{j ≥ i} v_j × g_j, and so on: sums over j are products with a triangle.
        # Σ_{j < i} (ω_j × v_i)·g_j = v_i · Σ_{j < i} g_j × ω_j.
        summed = crossed @ _SUMS
        gradient[ARM_XI] = _THREE @ (w * summed[:, :7] + v * summed[:, 7:]) * value
        return Manipulability(value, gradient)


def arm_omega(J: Array) -> float:
    """ω of the arm from the tool's Jacobian J (6×12)."""
    arm = J[:, ARM_Q]
    return float(np.sqrt(max(np.linalg.det(arm @ arm.T), 0.0)))


def arm_hessian(robot: RobotModel, q: Array) -> Array:
    """∂J/∂q of the tool over all of q, (6, 12, 12) as [row, column of J, q], by Pinocchio.

    Its Python binding returns the array with its axes mislabelled; reading the same memory in Fortran order as
    (6, nv, nv) is right, which the tests check against finite differences.
    """
    nv = robot.model.nv
    pin.computeJointJacobians(robot.model, robot.data, q)
    pin.computeJointKinematicHessians(robot.model, robot.data, q)
    raw: Any = pin.getFrameKinematicHessian(robot.model, robot.data, robot.tool_id, pin.LOCAL_WORLD_ALIGNED)
    return np.asarray(raw).ravel().reshape((6, nv, nv), order="F")
