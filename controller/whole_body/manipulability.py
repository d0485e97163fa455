"""Manipulability of the arm, ω = √det(J Jᵀ), and its gradient: the paper's constraint task 1 (eqs. 15 and 16).

The Jacobian is that of the ARM, as in the paper's text. The whole robot's Jacobian of the printed formula hides
singularities of the arm.
"""

import numpy as np
from msgspec import Struct

from controller.whole_body.compiled import MATRIX, NUMBER, VECTOR, cholesky, compiled, solve_cholesky
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI

_REGULAR = 1e-9


class Manipulability(Struct, frozen=True):
    """ω of the arm, and its gradient over ξ (9), whose wheel entries are exactly zero."""

    value: float
    gradient: Array


class ArmManipulability:
    """Computes ω and its gradient from the joint axes in the Jacobian's columns."""

    def at(self, J: Array) -> Manipulability:
        """ω and gradient from the tool's Jacobian J (6×12) of the current configuration."""
        gradient = np.zeros(NXI)
        return Manipulability(_climb(J[:, ARM_Q], gradient[ARM_XI]), gradient)


@compiled(NUMBER(MATRIX, VECTOR))
def _climb(J: Array, gradient: Array) -> float:
    """ω, and its gradient written into `gradient` (7), from the arm's Jacobian J (6×7).

    ∂ω/∂q_i = ω tr(J⁺ ∂J/∂q_i). The derivative of a revolute geometric Jacobian is written out here: with v_j, ω_j
    the columns, ∂v_j/∂q_i = ω_i × v_j for i ≤ j and ω_j × v_i for i > j; ∂ω_j/∂q_i = ω_i × ω_j for i < j, else 0.

    With (g, h) the columns of (J⁺)ᵀ the trace is Σ_j g_j · ∂_i v_j + h_j · ∂_i ω_j, and as (a × b)·c = a·(b × c),
    ω_i · (Σ_{j ≥ i} v_j × g_j + Σ_{j > i} ω_j × h_j) + v_i · Σ_{j < i} g_j × ω_j.
    """
    square = np.zeros((6, 6))
    for i in range(6):
        for j in range(i + 1):
            for k in range(7):
                square[i, j] += J[i, k] * J[j, k]
    # One Cholesky factorisation gives ω as the product of its diagonal, and (J⁺)ᵀ = (J Jᵀ)⁻¹ J.
    if not cholesky(square):
        return 0.0
    value = 1.0
    for i in range(6):
        value *= square[i, i]
    if value <= _REGULAR:
        return 0.0
    pinv_T = np.empty((7, 6))
    for k in range(7):
        for i in range(6):
            pinv_T[k, i] = J[i, k]
        solve_cholesky(square, pinv_T[k])
    above, below = np.zeros(3), np.zeros(3)
    for i in range(7):
        for r, s, t in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            gradient[i] += value * J[r, i] * below[r]
            below[r] += pinv_T[i, s] * J[3 + t, i] - pinv_T[i, t] * J[3 + s, i]
    for i in range(6, -1, -1):
        for r, s, t in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            above[r] += J[s, i] * pinv_T[i, t] - J[t, i] * pinv_T[i, s]
            gradient[i] += value * J[3 + r, i] * above[r]
            above[r] += J[3 + s, i] * pinv_T[i, 3 + t] - J[3 + t, i] * pinv_T[i, 3 + s]
    return value


def arm_omega(J: Array) -> float:
    """ω of the arm from the tool's Jacobian J (6×12)."""
    arm = J[:, ARM_Q]
    return float(np.sqrt(max(np.linalg.det(arm @ arm.T), 0.0)))
