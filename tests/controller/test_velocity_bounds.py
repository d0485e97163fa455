import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.velocity_bounds import VelocityBounds
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
BOX, ACTUATION = VelocityBounds(ROBOT, CONFIG.whole_body, DT), Actuation(ROBOT.drive)
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
    before = xi + rng.normal(0, 0.1, 9)
    bounds = BOX.at(q, xi, before)
    assert (bounds.lower <= bounds.upper).all()
    brake = BOX.brake(xi, before)
    slowest = np.concatenate([brake[:2], np.clip(brake, *_reachable(bounds))[2:]])
    assert inside(bounds, slowest)
    reach = ROBOT.limits.acceleration[ARM_XI] * CONFIG.whole_body.arm_acceleration_scale * DT + 1e-12
    assert (np.abs(bounds.upper - ACTUATION.nu(xi))[ARM_XI] <= reach).all()
    assert (np.abs(bounds.lower - ACTUATION.nu(xi))[ARM_XI] <= reach).all()


def _reachable(bounds):
    return ACTUATION.xi(bounds.lower), ACTUATION.xi(bounds.upper)


SHARES = {
    "as configured": CONFIG,
    "hasty": controller_config(whole_body__arm_velocity_scale=1.0, whole_body__arm_acceleration_scale=1.0),
}
SHARES["gentle"] = controller_config(whole_body__arm_jerk_scale=0.05)


@pytest.mark.long
@pytest.mark.parametrize("shares", SHARES)
@pytest.mark.parametrize("rate_hz", [100, 250, 1000])
@settings(max_examples=15, deadline=None)
@given(seeds)
def test_whatever_is_chosen_inside_the_bounds_no_limit_is_ever_broken(rate_hz, shares, seed):
    """For seconds an end of every joint's interval, the worst that can be chosen, or anything between, for any time."""
    config, dt, rng = SHARES[shares], 1.0 / rate_hz, np.random.default_rng(seed)
    box, limits = VelocityBounds(ROBOT, config.whole_body, dt), ROBOT.limits
    most = limits.velocity[ARM_XI] * config.whole_body.arm_velocity_scale + 1e-9
    acceleration = limits.acceleration[ARM_XI] * config.whole_body.arm_acceleration_scale + 1e-6
    jerk = limits.jerk[ARM_XI] * config.whole_body.arm_jerk_scale * (1 + 1e-6)
    margin = config.whole_body.joint_margin - 1e-9
    q, sent, before = at(rng.uniform(LOWER + margin, UPPER - margin)), np.zeros(9), np.zeros(9)
    for i in range(round(3.0 * rate_hz)):
        if rng.random() < rng.choice([2.0, 20.0]) * dt or i == 0:
            share = rng.choice([0.0, 1.0, 0.5], 9, p=[0.45, 0.45, 0.1])
        bounds = box.at(q, sent, before)
        assert (bounds.lower <= bounds.upper).all()
        nu = bounds.lower + share * (bounds.upper - bounds.lower)
        nu[:2] = 0.0
        q[ARM_Q] += nu[ARM_XI] * dt
        changed = nu - sent
        assert (np.abs(nu[ARM_XI]) <= most).all()
        assert (np.abs(changed[ARM_XI]) <= acceleration * dt).all()
        assert (np.abs((changed - (sent - before))[ARM_XI]) <= jerk * dt**2 + 1e-12).all()
        assert (q[ARM_Q] >= LOWER + margin).all() and (q[ARM_Q] <= UPPER - margin).all()
        before, sent = sent, nu


def test_a_joint_still_comes_to_its_limit_and_its_full_speed():
    """The bounds cost nothing but time: at 1 kHz a joint that is pushed uses what it has."""
    box, dt = VelocityBounds(ROBOT, CONFIG.whole_body, 0.001), 0.001
    q, sent, before, fastest = at(MIDDLE), np.zeros(9), np.zeros(9), np.zeros(7)
    for _ in range(3000):
        nu = box.at(q, sent, before).upper
        nu[:2] = 0.0
        q[ARM_Q] += nu[ARM_XI] * dt
        before, sent = sent, nu
        fastest = np.maximum(fastest, nu[ARM_XI])
    assert (UPPER - CONFIG.whole_body.joint_margin - q[ARM_Q] < 1e-3).all()
    np.testing.assert_allclose(fastest, ROBOT.limits.velocity[ARM_XI] * CONFIG.whole_body.arm_velocity_scale, rtol=0.02)


@pytest.mark.parametrize("rate_hz", [100, 1000])
@settings(max_examples=30, deadline=None)
@given(seeds)
def test_braking_for_a_reason_keeps_the_rated_jerk_and_comes_to_rest(rate_hz, seed):
    dt, rng = 1.0 / rate_hz, np.random.default_rng(seed)
    box, sent = VelocityBounds(ROBOT, CONFIG.whole_body, dt), rng.normal(0, 1, 9)
    before = sent - rng.uniform(-1, 1, 9) * ROBOT.limits.acceleration * CONFIG.whole_body.arm_acceleration_scale * dt
    for _ in range(round(2.0 * rate_hz)):
        new = box.brake(sent, before)
        jerk = np.abs(new - 2 * sent + before)[ARM_XI] / dt**2
        assert (jerk <= ROBOT.limits.jerk[ARM_XI] * (1 + 1e-6)).all()
        before, sent = sent, new
    assert not sent.any() and not before.any()


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_joint_outside_its_limit_has_to_come_back(joint, side):
    arm = MIDDLE.copy()
    arm[joint] = UPPER[joint] + 0.1 if side > 0 else LOWER[joint] - 0.1
    xi = before = np.zeros(9)
    for _ in range(400):
        bounds = BOX.at(at(arm), xi, before)
        # The least that is allowed.
        wanted = bounds.upper[2 + joint] if side > 0 else bounds.lower[2 + joint]
        xi, before = np.zeros(9), xi
        xi[2 + joint] = wanted
        arm[joint] += wanted * DT
    assert LOWER[joint] < arm[joint] < UPPER[joint]


def test_speeding_up_is_slower_than_braking_and_both_end_at_rest():
    q = at(MIDDLE)
    fast = ACTUATION.xi(np.array([0.2, 0.0, *[0.0] * 7]))
    bounds = BOX.at(q, fast, fast)
    assert bounds.upper[0] - 0.2 == pytest.approx(CONFIG.whole_body.base_acceleration * DT)
    assert 0.2 - bounds.lower[0] == pytest.approx(CONFIG.whole_body.base_braking * DT)
    crawling = ACTUATION.xi(np.array([0.001, 0.0, *[0.0] * 7]))
    slow = BOX.at(q, crawling, crawling)
    assert slow.lower[0] == pytest.approx(0.001 - CONFIG.whole_body.base_acceleration * DT)


def test_braking_comes_to_rest_along_the_arc():
    xi = np.array([2.0, 1.0, *[0.5] * 7])
    ratio = xi[0] / xi[1]
    for _ in range(100):
        xi = BOX.brake(xi, xi)
        if xi[1] > 1e-9:
            assert xi[0] / xi[1] == pytest.approx(ratio)
    assert not xi.any()
