import numpy as np
import pytest

from controller.config import MotionConfig, WholeBodyConfig
from controller.motion.body import BaseEstimate, wheels_ahead
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import DifferentialDrive
from tests.support.driven_base import DrivenBase

DRIVE = DifferentialDrive(0.13375, 0.2535)
POSE = (1.0, 2.0, 0.3)


def joints(at, left=0.0, right=0.0):
    return m.JointState(
        header=m.Header(at), sequence=1, position=(left, right, *map(float, range(2, 9))), velocity=(0.0,) * 9
    )


def odometry(at, pose=POSE, linear=0.0, angular=0.0):
    return m.Odometry(header=m.Header(at), sequence=1, pose=m.PlanarPose(*pose), linear=linear, angular=angular)


def test_the_first_odometry_is_carried_along_its_arc_to_the_joint_state():
    q = BaseEstimate(DRIVE).configuration(joints(10.02), odometry(10.0, linear=0.5, angular=0.2))
    np.testing.assert_allclose(q[:3], [1 + 0.01 * np.cos(0.302), 2 + 0.01 * np.sin(0.302), 0.304], atol=1e-6)
    np.testing.assert_array_equal(q[5:], np.arange(2, 9))


def test_old_odometry_is_not_guessed_from_for_long():
    q = BaseEstimate(DRIVE).configuration(joints(12.0), odometry(10.0, linear=0.5))
    assert q[0] - 1.0 == pytest.approx(0.05 * np.cos(0.3))


def follow(estimate, late, pose=POSE, ticks=40, every=2):
    """A base that after a while speeds up on an arc from `pose`; odometry comes `late` ticks of 10 ms later."""
    true, wheels, known, errors = np.array(pose), np.zeros(2), None, []
    coming = {}
    for i in range(ticks):
        if i % every == 0:
            coming[i + late] = odometry(i * 0.01, tuple(true), *DRIVE.twist(0.2 * max(i - 10, 0), 0.3 * max(i - 10, 0)))
        known = coming.get(i, known)
        if known is not None:
            errors.append(np.abs(estimate.configuration(joints(i * 0.01, *wheels), known)[:3] - true).max())
        turned = np.array([0.002, 0.003]) * max(i - 10, 0)
        true, wheels = DRIVE.integrate(true, *turned), wheels + turned
    return errors


@pytest.mark.parametrize("late", [0, 2, 5])
def test_late_odometry_is_made_up_for_by_what_the_wheels_have_turned_since(late):
    errors = follow(BaseEstimate(DRIVE), late)
    assert len(errors) == 40 - late
    assert max(errors) < 1e-3
    assert follow(BaseEstimate(DRIVE), 0)[-1] < 1e-9


def test_noise_of_the_odometry_moves_the_estimate_by_a_share():
    estimate = BaseEstimate(DRIVE)
    estimate.configuration(joints(0.0), odometry(0.0))
    q = estimate.configuration(joints(0.02), odometry(0.02, (1.001, 2.0, 0.3)))
    assert q[0] - 1.0 == pytest.approx(0.0002)
    for i in range(2, 50):
        q = estimate.configuration(joints(0.02 * i), odometry(0.02 * i, (1.001, 2.0, 0.3)))
    assert q[0] == pytest.approx(1.001, abs=1e-6)


def test_a_base_that_is_somewhere_else_is_believed_at_once():
    estimate = BaseEstimate(DRIVE)
    estimate.configuration(joints(0.0), odometry(0.0))
    q = estimate.configuration(joints(0.02), odometry(0.02, (3.0, -1.0, -3.0)))
    np.testing.assert_allclose(q[:3], [3.0, -1.0, 2 * np.pi - 3.0], atol=1e-9)


def test_a_heading_over_the_half_turn_is_no_jump():
    estimate = BaseEstimate(DRIVE)
    estimate.configuration(joints(0.0), odometry(0.0, (0.0, 0.0, 3.141)))
    q = estimate.configuration(joints(0.02), odometry(0.02, (0.0, 0.0, -3.141)))
    assert np.remainder(q[2], 2 * np.pi) == pytest.approx(3.141 + 0.2 * (2 * np.pi - 6.282))


def test_wheels_come_to_what_they_were_told_with_their_lag():
    wheels, sent = np.array([1.0, -1.0]), np.array([2.0, 0.0])
    np.testing.assert_array_equal(wheels_ahead(wheels, sent, 0.0, 0.1), wheels)
    np.testing.assert_allclose(wheels_ahead(wheels, sent, 0.1, 0.1), sent - np.exp(-1.0))
    np.testing.assert_array_equal(wheels_ahead(wheels, sent, 0.1, 0.0), sent)


@pytest.mark.long
@pytest.mark.parametrize("rates", [(100.0, 100.0), (1000.0, 50.0)])
@pytest.mark.parametrize(
    ("lag", "limits", "most"),
    [
        (0.1, WholeBodyConfig(base_acceleration=0.25), 0.0005),
        (MotionConfig().base_lag_s, WholeBodyConfig(), 0.0005),
        (0.1, WholeBodyConfig(), 0.001),
    ],
)
def test_the_tool_keeps_to_its_path_although_odometry_is_late_and_noisy(rates, lag, limits, most):
    """A base with a lag of 0.1 s that speeds up gently, and as configured with its own lag and with 0.1 s.

    Odometry is 20 ms late: against taking it as it comes.
    """
    runs = (DrivenBase(*rates, lag=lag, knows=knows, limits=limits).run() for knows in ("odometry", "predicted"))
    taken, predicted = (np.array(run.errors) for run in runs)
    assert predicted.max() < 0.2 * taken.max()
    assert predicted.max() < most
