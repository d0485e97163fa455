import numpy as np
import pytest

from controller.whole_body.joint_limits import LimitRepulsion, margin
from rolling_panda.model.robot import ARM_Q, RobotModel

LIMITS = RobotModel().limits
MIDDLE = (LIMITS.lower[ARM_Q] + LIMITS.upper[ARM_Q]) / 2
REPULSION = LimitRepulsion(LIMITS, gain=2.0, zone=0.25)


def at(joint, angle):
    q = np.zeros(12)
    q[ARM_Q] = MIDDLE
    q[5 + joint] = angle
    return q


def test_nothing_pushes_in_the_middle():
    assert not REPULSION.at(at(0, MIDDLE[0])).any()


@pytest.mark.parametrize("joint", range(7))
def test_push_leads_away_from_either_limit_and_is_largest_there(joint):
    low, high = LIMITS.lower[5 + joint], LIMITS.upper[5 + joint]
    pushes = [REPULSION.at(at(joint, low + d))[2 + joint] for d in (0.0, 0.1, 0.2)]
    assert pushes[0] > pushes[1] > pushes[2] > 0
    assert pushes[0] == pytest.approx(2.0 * 0.25**2)
    assert REPULSION.at(at(joint, high - 0.1))[2 + joint] == pytest.approx(-pushes[1])


def test_push_begins_without_a_jump():
    edge = LIMITS.lower[5] + 0.25
    inside = REPULSION.at(at(0, edge - 1e-6))[2]
    assert 0 < inside < 1e-10
    assert REPULSION.at(at(0, edge + 1e-6))[2] == 0


def test_wheels_are_never_pushed():
    assert not REPULSION.at(at(3, LIMITS.lower[8] - 0.1))[:2].any()


def test_margin_is_negative_outside():
    assert margin(at(5, LIMITS.upper[10] + 0.1), LIMITS) == pytest.approx(-0.1)
    assert margin(at(5, LIMITS.upper[10] - 0.2), LIMITS) == pytest.approx(0.2)
