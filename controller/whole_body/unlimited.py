"""What answers a problem where no inequality has a say: the first thing that the cascade tries, and mostly the last.

The tool's task is answered by the QR factorisation of its Jacobian's transpose, the lower tasks by normal equations in
the null space that the factorisation leaves. The names are those of `cascade.Problem`.
"""

import numpy as np

from controller.compiled import FLAG, MATRIX, NOTHING, NUMBER, PACKED, VECTOR, compiled
from controller.whole_body.small_matrices import (
    cholesky,
    inverse_norm_squared,
    orthogonalize,
    solve_cholesky,
    solve_upper_transposed,
)
from rolling_panda.differential_drive import Array

#: Makes the normal equations definite where no task has a say.
RIDGE = 1e-8


@compiled(NOTHING(MATRIX, VECTOR, PACKED, PACKED))
def factor(J: Array, speed: Array, Q: Array, R: Array) -> None:
    """Q (n×n, orthogonal) and R (n×m, its first m rows upper triangular) with (J · speed)ᵀ = Q R."""
    m, n = J.shape
    for i in range(m):
        for j in range(n):
            R[j, i] = J[i, j] * speed[j]
    orthogonalize(R, Q)


@compiled(
    FLAG(PACKED, PACKED, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, NUMBER, VECTOR)
)
def unlimited(
    Q: Array,
    R: Array,
    b: Array,
    c: Array,
    speed: Array,
    T: Array,
    t: Array,
    lower: Array,
    upper: Array,
    A: Array,
    A_lower: Array,
    A_upper: Array,
    damping_from: float,
    nu: Array,
) -> bool:
    """Write into nu (n) what answers everything; False where an inequality or damping has a say.

    Rᵀ y = b + c gives the tool its velocity; min ‖T (speed · (Q₁ y + Z z)) − t‖² gives z by its normal equations.
    """
    n, m = R.shape
    if inverse_norm_squared(R, m) * damping_from**2 > 1.0:
        return False
    y = b + c
    solve_upper_transposed(R, y)
    for i in range(n):
        nu[i] = 0.0
        for j in range(m):
            nu[i] += speed[i] * Q[i, j] * y[j]
    if n > m:
        H, z = np.zeros((n - m, n - m)), np.zeros(n - m)
        along = np.empty(n - m)
        for row in range(len(t)):
            rest = t[row]
            along[:] = 0.0
            for i in range(n):
                if T[row, i] != 0.0:
                    rest -= T[row, i] * nu[i]
                    for j in range(n - m):
                        along[j] += T[row, i] * speed[i] * Q[i, m + j]
            for j in range(n - m):
                z[j] += along[j] * rest
                for k in range(j + 1):
                    H[j, k] += along[j] * along[k]
        for j in range(n - m):
            H[j, j] += RIDGE
        if not cholesky(H):
            return False
        solve_cholesky(H, z)
        for i in range(n):
            for j in range(n - m):
                nu[i] += speed[i] * Q[i, m + j] * z[j]
    # What is not a number satisfies nothing.
    for i in range(n):
        if not lower[i] <= nu[i] <= upper[i]:
            return False
    for row in range(len(A_lower)):
        moved = 0.0
        for i in range(n):
            moved += A[row, i] * nu[i]
        if not A_lower[row] <= moved <= A_upper[row]:
            return False
    return True
