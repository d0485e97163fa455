"""Covariances of averaged places and directions."""

import numpy as np
import pytest

from perception.tracking import uncertainty


def averages(rng, noise, looks):
    values = rng.multivariate_normal(np.zeros(3), noise, looks)
    return values.mean(axis=0), np.cov(values.T, bias=True).reshape(3, 3)


@pytest.mark.parametrize("looks", [2, 5, 20])
def test_the_error_of_a_mean_is_as_large_as_its_covariance_says(looks):
    rng = np.random.default_rng(looks)
    noise = np.diag([0.001, 0.004, 0.002]) ** 2
    normalised = []
    for _ in range(400):
        mean, scatter = averages(rng, noise, looks)
        common = rng.normal(0.0, 0.0015, 3)
        covariance = uncertainty.of_place(scatter, looks)
        normalised.append((mean + common) @ np.linalg.solve(covariance, mean + common))
    # Three coordinates: 3 when it is exact.
    assert 1.5 < np.mean(normalised) < 4.5


def test_a_single_look_is_not_taken_for_the_truth_and_more_looks_tell_more():
    one, many = (uncertainty.of_place(np.zeros((3, 3)), looks) for looks in (1, 20))
    assert np.sqrt(one[0, 0]) > 0.002
    assert np.trace(many) < 0.5 * np.trace(one)
    assert np.sqrt(many[0, 0]) >= 0.0015, "the camera's own error does not average out"


def test_a_direction_is_uncertain_across_itself_only():
    direction = np.array([0.6, 0.0, 0.8])
    covariance = uncertainty.of_direction(0.01 * np.eye(3), 4, direction)
    assert direction @ covariance @ direction == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.matrix_rank(covariance, tol=1e-9) == 2
