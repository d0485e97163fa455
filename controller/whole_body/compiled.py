"""Compilation of functions over small arrays by Numba, and factorisations of small matrices.

At this size the overhead of a NumPy call exceeds its arithmetic: dozens of calls were most of a control step. Such a
function is compiled at the import of its module, for the types of its signature. So nothing is compiled while the robot
moves, and arguments of other types raise a TypeError. The machine code is cached beside the source, or in
NUMBA_CACHE_DIR.

A signature is the type of the result applied to those of the arguments: `NUMBER(VECTOR, MATRIX)`.
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from rolling_panda.model.differential_drive import Array

_Function = TypeVar("_Function", bound=Callable[..., Any])

NOTHING: Any = numba.void
FLAG: Any = numba.boolean
COUNT: Any = numba.int64
NUMBER: Any = numba.float64
PAIR: Any = numba.types.UniTuple(numba.float64, 2)
#: With any strides, so that views of larger arrays fit too.
VECTOR: Any = numba.float64[:]
MATRIX: Any = numba.float64[:, :]
#: C-contiguous.
PACKED: Any = numba.float64[:, ::1]


def records(dtype: Any) -> Any:
    """The type of a vector of such records, by which a function gets many named constants at the cost of one."""
    return numba.from_dtype(dtype)[::1]


def compiled(signature: Any) -> Callable[[_Function], _Function]:
    """Decorator: compile for one signature. Divisions by zero give infinities or NaN, as in NumPy."""

    def compile_now(function: _Function) -> _Function:
        try:
            return cast(_Function, numba.njit(signature, cache=True, error_model="numpy")(function))
        except (RuntimeError, OSError):
            # Without a writable cache folder, as on a read-only file system, every start compiles.
            return cast(_Function, numba.njit(signature, error_model="numpy")(function))

    return compile_now


@compiled(NOTHING(PACKED, PACKED))
def orthogonalize(A: Array, Q: Array) -> None:
    """QR factorisation by Householder's reflections (Golub and Van Loan, 5.2).

    Args:
        A: n×m with m ≤ n; becomes R in its upper triangle, zeros below.
        Q: n×n; becomes orthogonal with A = Q[:, :m] R[:m]. Its other columns span what is orthogonal to A's.
    """
    n, m = A.shape
    for i in range(n):
        for j in range(n):
            Q[i, j] = 1.0 if i == j else 0.0
    for k in range(m):
        length = 0.0
        for i in range(k, n):
            length += A[i, k] * A[i, k]
        length = math.sqrt(length)
        if length == 0.0:
            continue
        # The reflection I − β w wᵀ maps the column to ∓length; the sign avoids cancellation in w.
        head = A[k, k]
        diagonal = -length if head > 0.0 else length
        first = head - diagonal
        beta = -first / diagonal
        for i in range(k + 1, n):
            A[i, k] /= first
        for j in range(k + 1, m):
            along = A[k, j]
            for i in range(k + 1, n):
                along += A[i, k] * A[i, j]
            along *= beta
            A[k, j] -= along
            for i in range(k + 1, n):
                A[i, j] -= along * A[i, k]
        for i in range(n):
            along = Q[i, k]
            for j in range(k + 1, n):
                along += Q[i, j] * A[j, k]
            along *= beta
            Q[i, k] -= along
            for j in range(k + 1, n):
                Q[i, j] -= along * A[j, k]
        A[k, k] = diagonal
        for i in range(k + 1, n):
            A[i, k] = 0.0


@compiled(FLAG(PACKED, VECTOR))
def solve_upper_transposed(R: Array, x: Array) -> bool:
    """Solve Rᵀ y = x for the m×m upper triangle of R, in place of x (m). False where R is singular."""
    for i in range(len(x)):
        if R[i, i] == 0.0:
            return False
        rest = x[i]
        for k in range(i):
            rest -= R[k, i] * x[k]
        x[i] = rest / R[i, i]
    return True


@compiled(NUMBER(PACKED, COUNT))
def inverse_norm_squared(R: Array, m: int) -> float:
    """‖R⁻¹‖² (Frobenius) of the m×m upper triangle of R, whose inverse is no larger than its smallest singular value.

    Infinite where R is singular.
    """
    total = 0.0
    for i in range(m):
        if R[i, i] == 0.0:
            return math.inf
    x = np.empty(m)
    for column in range(m):
        for i in range(column, -1, -1):
            rest = 1.0 if i == column else 0.0
            for k in range(i + 1, column + 1):
                rest -= R[i, k] * x[k]
            x[i] = rest / R[i, i]
            total += x[i] * x[i]
    return total


@compiled(FLAG(PACKED))
def cholesky(A: Array) -> bool:
    """A = L Lᵀ: L in place of A's lower triangle. False where A is not positive definite."""
    n = len(A)
    for j in range(n):
        for i in range(j, n):
            rest = A[i, j]
            for k in range(j):
                rest -= A[i, k] * A[j, k]
            if i > j:
                A[i, j] = rest / A[j, j]
            elif rest > 0.0:
                A[j, j] = math.sqrt(rest)
            else:
                return False
    return True


@compiled(NOTHING(PACKED, VECTOR))
def solve_cholesky(L: Array, x: Array) -> None:
    """Solve L Lᵀ y = x in place of x, with L from `cholesky`."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
