"""Strict priorities as a cascade of two small dense quadratic programs.

With the velocities scaled by their limits, ν̄ = ν/ν_max, the Jacobian J over ν̄ and the QR factorisation Jᵀ = Q₁ R,
every ν̄ is Q₁ y + Z z with Z spanning ker J: J ν̄ = Rᵀ y, whatever z is.

1. Bounds and rows are constraints of both programs. If they are infeasible together, the rows (never the bounds) are
   first relaxed by the smallest amount in the least-squares sense.
2. Tool: min ‖Rᵀ y − α b − c‖² + κ‖b‖² (1 − α)² + λ²‖y‖² + ε‖z − z_sent‖² over y, z, 0 ≤ α ≤ α_max.
3. Null space: min ‖T ν − t‖² over z alone, with y and α from step 2. It cannot change the tool's velocity.

If the unconstrained optimum satisfies all inequalities, it is the solution, and the programs are not run.
"""

import math
from typing import Any

import daqp
import numpy as np
from msgspec import Struct
from scipy.linalg.lapack import dsyev

from controller.whole_body.compiled import (
    FLAG,
    MATRIX,
    NOTHING,
    NUMBER,
    PACKED,
    VECTOR,
    cholesky,
    compiled,
    inverse_norm_squared,
    orthogonalize,
    solve_cholesky,
    solve_upper_transposed,
)
from rolling_panda.model.differential_drive import Array

#: κ: the deviation from the path is about this fraction of the velocity that is missing along it.
_SLOWER = 1e-3
#: ε: makes the first program's answer unique. Small against κ, so that the tool is not slowed to spare the null space,
#: but not so small that joints race for a hundredth more of its speed.
_IDLE = 3e-5
#: Below this target velocity of the tool (as a fraction of its limits) there is nothing to scale.
_NOTHING = 1e-5
#: Slack from which a row counts as relaxed.
_GIVEN_UP = 1e-6
#: Margin added to a row's relaxation (in its unit): at the minimum only one velocity is feasible, which a solver
#: with rounding may not find.
_ROOM = 1e-8
#: A velocity below this fraction of its limit counts as zero.
_STANDS = 0.02
_SETTINGS = {"primal_tol": 1e-10}
_FREE = 1e30


class Problem(Struct, frozen=True):
    """Problem of one period, over the n free velocities, with k rows. The first `soft` rows may be relaxed.

    Attributes:
        J: Jacobian of the tool's task (m×n), its rows scaled so that a velocity at the limit has length 1.
        b: Target of J ν − c (m), scaled likewise; it may be slowed by α.
        c: Part of the target that is not slowed (m), scaled likewise.
        speed: Largest ν (n).
        sent: Last ν (n).
        lower: Lower bound of ν (n).
        upper: Upper bound of ν (n).
        A: Rows over ν (k×n).
        A_lower: Lower bound of A ν (k); −inf for none.
        A_upper: Upper bound of A ν (k); inf for none.
        soft: Number of rows that may be relaxed.
        T: Rows of the null-space tasks (…×n), weighted.
        t: Their targets, weighted.
        scale: Largest α.
        keep_path: False fixes α at 1.
    """

    J: Array
    b: Array
    c: Array
    speed: Array
    sent: Array
    lower: Array
    upper: Array
    A: Array
    A_lower: Array
    A_upper: Array
    soft: int
    T: Array
    t: Array
    scale: float
    keep_path: bool


class Answer(Struct, frozen=True):
    """Solution of the cascade.

    Attributes:
        nu: Velocities (n).
        scale: α.
        slack: Relaxation of each soft row, in its unit; None without one.
        holds: Index of the bound (0…n−1) or row (n…) that limits the tool the most; −1 for none.
        missing: Fraction of b that J ν lacks if α is fixed, 0 otherwise.
    """

    nu: Array
    scale: float
    slack: Array | None
    holds: int
    missing: float = 0.0


class Cascade:
    """Solves problems. `damping` is λ² at a singularity, `damping_from` the singular value where it begins."""

    def __init__(self, damping: float, damping_from: float) -> None:
        """Bind the settings."""
        self._damping, self._damping_from = damping, damping_from
        self._senses: dict[int, Array] = {}
        self._ridges: dict[int, Array] = {}

    def solve(self, p: Problem) -> Answer | None:
        """The velocities, or None where the solver found none."""
        m, n = p.J.shape
        k = p.A.shape[0]
        Q, R, nu = np.empty((n, n)), np.empty((n, m)), np.empty(n)
        factor(p.J, p.speed, Q, R)
        if not (p.keep_path and p.scale < 1.0) and unconstrained_solution(
            Q, R, p.b, p.c, p.speed, p.T, p.t, p.lower, p.upper, p.A, p.A_lower, p.A_upper, self._damping_from, nu
        ):
            return Answer(nu, 1.0, None, -1)
        R = R[:m]
        # Rows over [y, z]: first the bounds of ν̄, then the others.
        rows = np.empty((n + k, 1 + n))
        rows[:, 0] = 0.0
        rows[:n, 1:] = Q
        low, high = np.empty(1 + n + k), np.empty(1 + n + k)
        low[1 : 1 + n], high[1 : 1 + n] = p.lower / p.speed, p.upper / p.speed
        slack = None
        if k:
            A = p.A * p.speed
            rows[n:, 1:] = A @ Q
            low[1 + n :], high[1 + n :] = p.A_lower, p.A_upper
        found = self._tool(p, Q, R, rows, low, high)
        if found is None:
            slack = self._relax(rows[:, 1:], low[1:], high[1:], n, p.soft)
            if slack is None:
                return None
            low[1 + n : 1 + n + p.soft] -= slack
            found = self._tool(p, Q, R, rows, low, high)
            if found is None:
                return None
        v, scale, multipliers = found
        z = self._null_space(p, Q, m, v, rows[:, 1:], low[1:], high[1:])
        x = Q[:, :m] @ v[1 : 1 + m] + Q[:, m:] @ z
        nu = np.minimum(np.maximum(x * p.speed, p.lower), p.upper)
        if p.keep_path:
            return Answer(nu, scale, slack, int(np.abs(multipliers[1:]).argmax()) if scale < 1.0 else -1)
        rest = R.T @ v[1 : 1 + m] - p.b - p.c
        missing = math.sqrt(float(rest @ rest) / max(float(p.b @ p.b), _NOTHING**2))
        return Answer(nu, scale, slack, _active_constraint(multipliers[1:], nu, p.speed), missing)

    def _tool(
        self, p: Problem, Q: Array, R: Array, rows: Array, low: Array, high: Array
    ) -> tuple[Array, float, Array] | None:
        """The variables [α‖b‖, y, z], α, and the constraints' multipliers."""
        m, n = p.J.shape
        H, f = np.zeros((1 + n, 1 + n)), np.zeros(1 + n)
        size = math.sqrt(float(p.b @ p.b))
        tool = R @ R.T
        H[1 : 1 + m, 1 : 1 + m] = tool
        damping = self._damped(tool)
        H.ravel()[(1 + m) * (2 + n) :: 2 + n] = _IDLE
        f[1 + m :] = (-_IDLE * (p.sent / p.speed)) @ Q[:, m:]
        if damping > 0.0:
            H.ravel()[2 + n : (1 + m) * (2 + n) : 2 + n] += damping
        fixed = p.scale if p.keep_path else 1.0
        scaled = p.keep_path and size > _NOTHING
        if scaled:
            # α‖b‖ instead of α: a small b must not make the program badly conditioned.
            way = p.b / size
            H[0, 0] = 1.0 + _SLOWER
            H[0, 1 : 1 + m] = H[1 : 1 + m, 0] = -(R @ way)
            f[0] = float(way @ p.c) - _SLOWER * size
            f[1 : 1 + m] = -(R @ p.c)
            low[0], high[0] = 0.0, p.scale * size
        else:
            H[0, 0] = 1.0
            f[1 : 1 + m] = -(R @ (fixed * p.b + p.c))
            low[0], high[0] = -1.0, 1.0
        v, _, flag, info = daqp.solve(H, f, rows, high, low, self._sense(len(high)), **_SETTINGS)
        if flag < 1 or not math.isfinite(float(v.sum())):
            return None
        scale = min(max(float(v[0]) / size, 0.0), 1.0) if scaled else fixed
        return v, scale, info["lam"]

    def _null_space(self, p: Problem, Q: Array, m: int, v: Array, rows: Array, low: Array, high: Array) -> Array:
        """The null-space part z that serves the lower tasks best."""
        n = p.J.shape[1]
        y, z = v[1 : 1 + m], v[1 + m :]
        if n == m:
            return z
        Z = Q[:, m:]
        A = p.T @ (Z * p.speed[:, None])
        rest = p.T @ ((Q[:, :m] @ y) * p.speed) - p.t
        H = A.T @ A + self._ridge(n - m)
        fixed = rows[:, :m] @ y
        free = np.ascontiguousarray(rows[:, m:])
        # The first program's z is feasible; rounding must not make it infeasible.
        at = free @ z
        lower, upper = np.minimum(low - fixed, at), np.maximum(high - fixed, at)
        found, _, flag, _ = daqp.solve(H, rest @ A, free, upper, lower, self._sense(len(upper)), **_SETTINGS)
        return found if flag >= 1 and math.isfinite(float(found.sum())) else z

    def _relax(self, rows: Array, low: Array, high: Array, n: int, soft: int) -> Array | None:
        """Relaxation of each soft row's lower bound in the least-squares sense, with all other constraints hard."""
        if not soft:
            return None
        size = n + soft
        H = np.eye(size)
        H.ravel()[: n * size : size + 1] = 1e-8
        A = np.zeros((len(rows), size))
        A[:, :n] = rows
        A[n : n + soft, n:] = np.eye(soft)
        lower = np.concatenate([np.full(n, -_FREE), np.zeros(soft), low])
        upper = np.concatenate([np.full(size, _FREE), high])
        v, _, flag, _ = daqp.solve(H, np.zeros(size), A, upper, lower, self._sense(len(upper)), **_SETTINGS)
        if flag < 1 or not math.isfinite(float(v.sum())):
            return None
        slack: Array = np.maximum(v[n:], 0.0)
        slack[slack > 0.0] += _ROOM
        return slack

    def _damped(self, tool: Array) -> float:
        """λ², from the smallest eigenvalue σ² of J Jᵀ."""
        values, _, info = dsyev(tool, compute_v=0)
        if info != 0:
            return self._damping
        near = max(float(values[0]), 0.0) / self._damping_from**2
        return self._damping * (1.0 - near) if near < 1.0 else 0.0

    def _sense(self, count: int) -> Any:
        found = self._senses.get(count)
        if found is None:
            found = self._senses[count] = np.zeros(count, dtype=np.int32)
        return found

    def _ridge(self, size: int) -> Array:
        """Regularisation that makes the null space's program positive definite."""
        found = self._ridges.get(size)
        if found is None:
            found = self._ridges[size] = RIDGE * np.eye(size)
        return found


def _active_constraint(multipliers: Array, nu: Array, speed: Array) -> int:
    """Index of the strongest active row, or of the bound of a velocity that is forced to zero; −1 for none.

    A bound that is active at a large velocity is temporary and does not count.
    """
    strength = np.abs(multipliers)
    strength[: len(nu)][np.abs(nu) > _STANDS * speed] = 0.0
    strongest = int(strength.argmax())
    return strongest if float(strength[strongest]) > 0.0 else -1


def given_up(slack: Array | None) -> int:
    """Index of the row that was moved the most, −1 where none was by more than rounding."""
    if slack is None or not len(slack):
        return -1
    worst = int(slack.argmax())
    return worst if float(slack[worst]) > _GIVEN_UP else -1


#: Regularisation that makes the normal equations positive definite.
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
def unconstrained_solution(
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
    """Write the unconstrained optimum into nu (n). Returns False if an inequality or damping is active.

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
    # NaN satisfies no bound.
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
