import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.whole_body.compiled import (
    cholesky,
    inverse_norm_squared,
    orthogonalize,
    solve_cholesky,
    solve_upper_transposed,
)

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(1, 9), st.integers(0, 4))
def test_a_factorisation_is_orthogonal_triangular_and_gives_the_matrix_back(seed, m, more):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(m + more, m)) * 10.0 ** rng.uniform(-6, 3, m)
    A[:, rng.random(m) < 0.2] = 0.0
    R, Q = A.copy(), np.empty((m + more, m + more))
    orthogonalize(R, Q)
    np.testing.assert_allclose(Q.T @ Q, np.eye(m + more), atol=1e-13)
    assert not np.tril(R, -1).any()
    np.testing.assert_allclose(Q @ R, A, atol=1e-12 * np.abs(A).max() + 1e-300)


@given(seeds, st.integers(1, 9))
def test_triangles_are_solved(seed, m):
    rng = np.random.default_rng(seed)
    R = np.triu(rng.normal(size=(m, m))) + 3.0 * np.eye(m)
    x = rng.normal(size=m)
    y = x.copy()
    assert solve_upper_transposed(R, y)
    np.testing.assert_allclose(R.T @ y, x, atol=1e-9)
    inverse = np.linalg.inv(R)
    assert inverse_norm_squared(R, m) == pytest.approx(float((inverse * inverse).sum()), rel=1e-9)


@given(seeds, st.integers(1, 9))
def test_a_definite_matrix_is_solved(seed, n):
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n + 2))
    A = B @ B.T + 0.1 * np.eye(n)
    L, x = A.copy(), rng.normal(size=n)
    y = x.copy()
    assert cholesky(L)
    solve_cholesky(L, y)
    np.testing.assert_allclose(A @ y, x, atol=1e-9)


def test_what_cannot_be_solved_is_said_to_be_so():
    R = np.array([[1.0, 2.0], [0.0, 0.0]])
    assert not solve_upper_transposed(R, np.ones(2))
    assert inverse_norm_squared(R, 2) == np.inf
    assert not cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert not cholesky(np.array([[np.nan]]))
