"""The rows of the hierarchy's problem over ν, from what is known over ξ̇, and ξ̇ from the ν that answers it.

`wheels` (2×2) gives the wheels' speeds of [v, ω] throughout.
"""

import math

import numpy as np

from controller.compiled import COUNT, MATRIX, NOTHING, NUMBER, PACKED, VECTOR, compiled
from rolling_panda.differential_drive import Array


@compiled(NUMBER(MATRIX, MATRIX, VECTOR, NUMBER, PACKED, VECTOR, PACKED, VECTOR))
def tool_rows(
    J_xi: Array, R: Array, twist: Array, speed_cap: float, wheels: Array, weight: Array, J: Array, b: Array
) -> float:
    """Write J (m×9) and b (m) of the tool's task; m = 5 leaves the rotation about the tool's y free.

    Args:
        J_xi: Over ξ̇ (6×9).
        R: Rotation of the tool, R_odom_tool (3×3).
        twist: Wanted (6).
        speed_cap: Largest speed of the tool's origin (m/s); b is of a twist that is slowed to it.
        wheels: Of [v, ω].
        weight: Of the rows (6).
        J: Written.
        b: Written.

    Returns:
        The share of the twist that the speed cap allows, 0…1.
    """
    m = len(b)
    speed = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
    share = max(speed_cap, 0.0) / speed if speed > speed_cap else 1.0
    for row in range(m):
        for j in range(9):
            J[row, j] = 0.0
        b[row] = 0.0
        # About the tool's own x and z where its y is free, about odom's axes otherwise.
        axis = 2 * (row - 3)
        for i in range(6):
            along = 1.0 if i == row else 0.0
            if m == 5 and row >= 3:
                along = R[i - 3, axis] if i >= 3 else 0.0
            if along != 0.0:
                along *= weight[row]
                b[row] += along * share * twist[i]
                for j in range(2):
                    J[row, j] += along * (J_xi[i, 0] * wheels[0, j] + J_xi[i, 1] * wheels[1, j])
                for j in range(2, 9):
                    J[row, j] += along * J_xi[i, j]
    return share


@compiled(COUNT(MATRIX, VECTOR, PACKED, COUNT, PACKED, VECTOR, VECTOR))
def guard_rows(A_xi: Array, least: Array, wheels: Array, at: int, A: Array, lower: Array, upper: Array) -> int:
    """Write rows A_xi ξ̇ ≥ least (k×9, k) into A, lower and upper from row `at` on; returns the row after them."""
    for i in range(len(least)):
        for j in range(2):
            A[at, j] = A_xi[i, 0] * wheels[0, j] + A_xi[i, 1] * wheels[1, j]
        for j in range(2, 9):
            A[at, j] = A_xi[i, j]
        lower[at], upper[at] = least[i], math.inf
        at += 1
    return at


@compiled(NOTHING(PACKED, VECTOR, VECTOR, COUNT, PACKED, VECTOR, VECTOR))
def wheel_rows(wheels: Array, least: Array, most: Array, at: int, A: Array, lower: Array, upper: Array) -> None:
    """Write the bounds of the wheels' speeds (2) into A, lower and upper from row `at` on."""
    for i in range(2):
        for j in range(9):
            A[at + i, j] = wheels[i, j] if j < 2 else 0.0
        lower[at + i], upper[at + i] = least[i], most[i]


def without_base(rows: Array, base: Array, rest: Array) -> Array:
    """What rows (k×9, over ν or ξ̇) leave of `rest` (k) for the arm, the base's share of them being `base` (2)."""
    left = np.empty(len(rest))
    _without_base(rows, base, rest, left)
    return left


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, VECTOR))
def _without_base(rows: Array, base: Array, rest: Array, left: Array) -> None:
    for i in range(len(rest)):
        left[i] = rest[i] - rows[i, 0] * base[0] - rows[i, 1] * base[1]


@compiled(NOTHING(VECTOR, VECTOR, PACKED, VECTOR, VECTOR, VECTOR))
def sendable(nu: Array, base: Array, wheels: Array, least: Array, most: Array, xi: Array) -> None:
    """Write ξ̇ (9): of ν (9), or of ν without its first two (7) where the base does `base` (2) by itself.

    Rounding of the way back to the wheels' speeds stays inside their bounds `least` and `most` (2).
    """
    fixed = 9 - len(nu)
    v, omega = (base[0], base[1]) if fixed else (nu[0], nu[1])
    for i in range(2):
        xi[i] = min(max(wheels[i, 0] * v + wheels[i, 1] * omega, least[i]), most[i])
    for i in range(2, 9):
        xi[i] = nu[i - fixed]
