"""How near the actuators are to their limits."""

import pytest

from rolling_panda.messages.robot import JointState
from rolling_panda.messages.types import Header
from rolling_panda.model.robot import RobotModel
from server.robots.limits import speed_shares

ARM = (0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.7)


@pytest.fixture(scope="module")
def limits():
    return RobotModel().limits


def state(arm=ARM, velocity=(0.0,) * 9):
    return JointState(header=Header(), sequence=1, position=(50.0, -50.0, *arm), velocity=velocity)


def test_a_wheel_and_a_joint_at_half_and_at_all_of_their_speed(limits):
    shares = speed_shares(state(velocity=(-5.6, 0.0, 0.0, 2.175, 0.0, 0.0, 0.0, 0.0, -1.305)), limits)
    assert shares == pytest.approx((0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.5), abs=1e-3)
