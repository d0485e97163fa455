import numpy as np
import pytest

from controller.estimate import configuration_now
from rolling_panda import messages as m
from rolling_panda.differential_drive import DifferentialDrive

DRIVE = DifferentialDrive(0.13375, 0.2535)


def now(joints_at, odometry_at, linear=0.5, angular=0.2):
    joints = m.JointState(
        header=m.Header(joints_at), sequence=1, position=tuple(float(i) for i in range(9)), velocity=(0.0,) * 9
    )
    odometry = m.Odometry(
        header=m.Header(odometry_at), sequence=1, pose=m.PlanarPose(1.0, 2.0, 0.3), linear=linear, angular=angular
    )
    return configuration_now(joints, odometry, DRIVE)


def test_base_is_carried_forward_to_the_joint_states():
    q = now(10.02, 10.0)
    np.testing.assert_allclose(q[:3], [1 + 0.01 * np.cos(0.302), 2 + 0.01 * np.sin(0.302), 0.304], atol=1e-6)
    np.testing.assert_array_equal(q[3:], np.arange(9))


@pytest.mark.parametrize("joints_at", [9.0, 10.0])
def test_base_is_never_carried_back(joints_at):
    np.testing.assert_array_equal(now(joints_at, 10.0)[:3], [1.0, 2.0, 0.3])


def test_old_odometry_is_not_guessed_from_for_long():
    assert now(12.0, 10.0, angular=0.0)[0] - 1.0 == pytest.approx(0.05 * np.cos(0.3))


def test_a_resting_base_stays():
    np.testing.assert_array_equal(now(10.02, 10.0, 0.0, 0.0)[:3], [1.0, 2.0, 0.3])
