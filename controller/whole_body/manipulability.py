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
#: [j, i] is 1 where j ≥ i, j > i and j < i: summing columns j for each i.
_FROM = np.tril(np.ones((7, 7)))
_AFTER = np.tril(np.ones((7, 7)), -1)
_BEFORE = np.triu(np.ones((7, 7)), 1)


@dataclass(frozen=True)
class Manipulability:
    """ω of the arm, and its gradient over ξ (9), whose wheel entries are exactly zero."""

    value: float
    gradient: Array


class ArmManipulability:
    """Computes ω and its gradient from the joints' axes, which the Jacobian's columns hold."""

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
        g, h = pinv_T[:3], pinv_T[3:]
        crossed = _cross(np.hstack((v, w, g)), np.hstack((g, h, w)))
        vg, wh, gw = crossed[:, :7], crossed[:, 7:14], crossed[:, 14:]
        # Σ_{j ≥ i} (ω_i × v_j)·g_j = ω_i · Σ_{j ≥ i} v_j × g_j, and so on: sums over j are products with a triangle.
        # Σ_{j < i} (ω_j × v_i)·g_j = v_i · Σ_{j < i} g_j × ω_j.
        tail = vg @ _FROM + wh @ _AFTER
        head = gw @ _BEFORE
        gradient[ARM_XI] = value * (w * tail + v * head).sum(axis=0)
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


def _cross(a: Array, b: Array) -> Array:
    """Cross products of the columns of two 3×n arrays, without numpy.cross's overhead."""
    out = np.empty_like(a)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out
