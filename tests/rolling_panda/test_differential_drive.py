import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rolling_panda.model.differential_drive import DifferentialDrive

R, MU = 0.13375, 0.2535
angles = st.floats(-10, 10)
rhos = st.sampled_from([0.0, 0.15, -0.3])
turns = st.floats(-3, 3)


@given(angles, rhos)
def test_basis_spans_the_null_space_of_the_constraints(phi, rho):
    drive = DifferentialDrive(R, MU, rho)
    A, S = drive.constraint(phi), drive.basis(phi)
    np.testing.assert_allclose(A @ S, 0, atol=1e-12)
    assert np.linalg.matrix_rank(A) == 3
    assert np.linalg.matrix_rank(S) == 9


def test_left_wheel_forward_turns_right_and_both_drive_ahead():
    S = DifferentialDrive(R, MU).basis(0.0)
    assert (S @ np.eye(9)[0])[2] < 0
    both = S @ np.array([1.0, 1.0, 0, 0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(both[:3], [R, 0, 0], atol=1e-12)


@settings(max_examples=40)
@given(angles, rhos, turns, turns)
def test_heading_follows_the_difference_of_the_wheels(phi, rho, left, right):
    """φ − R (θ_r − θ_l) / 2μ does not change, whatever the wheels do."""
    drive = DifferentialDrive(R, MU, rho)
    rate = drive.basis(phi) @ np.array([left, right, 0, 0, 0, 0, 0, 0, 0])
    assert rate[2] == pytest.approx(R * (rate[4] - rate[3]) / (2 * MU))
    pose = drive.integrate(np.array([0.3, -0.2, phi]), left, right)
    assert pose[2] - R * (right - left) / (2 * MU) == pytest.approx(phi)


@settings(max_examples=40, deadline=None)
@given(angles, rhos, turns, turns)
def test_odometry_arc_is_the_limit_of_many_small_steps_along_the_basis(phi, rho, left, right):
    drive = DifferentialDrive(R, MU, rho)
    start = np.array([0.3, -0.2, phi])
    xi = np.array([left, right, 0, 0, 0, 0, 0, 0, 0])
    pose, steps = start.copy(), 400
    for _ in range(steps):
        middle = pose + (drive.basis(pose[2]) @ xi)[:3] / (2 * steps)
        pose = pose + (drive.basis(middle[2]) @ xi)[:3] / steps
    np.testing.assert_allclose(drive.integrate(start, left, right), pose, atol=1e-5)


def test_a_full_turn_in_place_comes_back():
    drive = DifferentialDrive(R, MU, 0.1)
    turned = 2 * np.pi * MU / R
    start = np.array([1.0, 2.0, 0.4])
    np.testing.assert_allclose(drive.integrate(start, -turned, turned) - start, [0, 0, 2 * np.pi], atol=1e-12)


@given(turns, turns)
def test_twist_and_wheels_are_inverse(v, omega):
    drive = DifferentialDrive(R, MU)
    assert drive.twist(*drive.wheels(v, omega)) == pytest.approx((v, omega), abs=1e-9)
