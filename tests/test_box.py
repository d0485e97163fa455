import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.box import Box
from rolling_panda.robot_model import ARM_Q, ARM_XI, RobotModel

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
BOX, ACTUATION = Box(ROBOT, CONFIG, DT), Actuation(ROBOT.drive)
LOWER, UPPER = ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q]
MIDDLE = (LOWER + UPPER) / 2
seeds = st.integers(0, 2**32 - 1)


def at(arm):
    q = np.zeros(12)
    q[ARM_Q] = arm
    return q


def inside(bounds, xi):
    nu = ACTUATION.nu(xi)
    return (
        (nu <= bounds.upper + 1e-9).all()
        and (nu >= bounds.lower - 1e-9).all()
        and (xi[:2] <= bounds.wheel_upper + 1e-9).all()
        and (xi[:2] >= bounds.wheel_lower - 1e-9).all()
    )


@settings(max_examples=200)
@given(seeds)
def test_something_is_possible_from_any_state(seed):
    """Also beyond limits and at velocities far too high; and it never takes more than the acceleration allows."""
    rng = np.random.default_rng(seed)
    q = at(rng.uniform(LOWER - 0.3, UPPER + 0.3))
    xi = rng.normal(0, 1, 9) * np.array([3.0, 3.0, *[1.5] * 7])
    bounds = BOX.at(q, xi)
    assert (bounds.lower <= bounds.upper).all()
    brake = BOX.brake(xi)
    slowest = np.concatenate([brake[:2], np.clip(brake, *_reachable(bounds))[2:]])
    assert inside(bounds, slowest)
    reach = ROBOT.limits.acceleration[ARM_XI] * CONFIG.arm_acceleration_share * DT + 1e-12
    assert (np.abs(bounds.upper - ACTUATION.nu(xi))[ARM_XI] <= reach).all()
    assert (np.abs(bounds.lower - ACTUATION.nu(xi))[ARM_XI] <= reach).all()


def _reachable(bounds):
    return ACTUATION.xi(bounds.lower), ACTUATION.xi(bounds.upper)


@settings(max_examples=60)
@given(seeds)
def test_pushing_at_the_bounds_for_seconds_breaks_no_limit(seed):
    """The worst that anybody may choose inside the bounds: always an end of every joint's interval."""
    rng = np.random.default_rng(seed)
    q, xi = at(rng.uniform(LOWER + 0.05, UPPER - 0.05)), np.zeros(9)
    ends = rng.integers(0, 2, 9).astype(bool)
    for i in range(400):
        if i % 50 == 0:
            ends = rng.integers(0, 2, 9).astype(bool)
        bounds = BOX.at(q, xi)
        nu = np.where(ends, bounds.upper, bounds.lower)
        nu[:2] = 0.0
        new = ACTUATION.xi(nu)
        assert (np.abs(new - xi) <= ROBOT.limits.acceleration * DT + 1e-9).all()
        assert (np.abs(new) <= ROBOT.limits.velocity + 1e-9).all()
        xi = new
        q[3:] += xi * DT
        assert (q[ARM_Q] >= LOWER).all() and (q[ARM_Q] <= UPPER).all()


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_joint_outside_its_limit_has_to_come_back(joint, side):
    arm = MIDDLE.copy()
    arm[joint] = UPPER[joint] + 0.1 if side > 0 else LOWER[joint] - 0.1
    xi = np.zeros(9)
    for _ in range(400):
        bounds = BOX.at(at(arm), xi)
        # The least that is allowed.
        wanted = bounds.upper[2 + joint] if side > 0 else bounds.lower[2 + joint]
        xi = np.zeros(9)
        xi[2 + joint] = wanted
        arm[joint] += wanted * DT
    assert LOWER[joint] < arm[joint] < UPPER[joint]


def test_speeding_up_is_slower_than_braking_and_both_end_at_rest():
    q = at(MIDDLE)
    bounds = BOX.at(q, ACTUATION.xi(np.array([0.2, 0.0, *[0.0] * 7])))
    assert bounds.upper[0] - 0.2 == pytest.approx(CONFIG.base_acceleration * DT)
    assert 0.2 - bounds.lower[0] == pytest.approx(CONFIG.base_braking * DT)
    slow = BOX.at(q, ACTUATION.xi(np.array([0.001, 0.0, *[0.0] * 7])))
    assert slow.lower[0] == pytest.approx(0.001 - CONFIG.base_acceleration * DT)


def test_braking_comes_to_rest_along_the_arc():
    xi = np.array([2.0, 1.0, *[0.5] * 7])
    ratio = xi[0] / xi[1]
    for _ in range(100):
        xi = BOX.brake(xi)
        if xi[1] > 1e-9:
            assert xi[0] / xi[1] == pytest.approx(ratio)
    assert not xi.any()
