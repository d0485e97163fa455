import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import WholeBodyConfig
from controller.whole_body.saturation import Saturation
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
DT = 0.01
SATURATION = Saturation(ROBOT, WholeBodyConfig(), DT)
LOWER, UPPER = ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q]
seeds = st.integers(0, 2**32 - 1)


def middle():
    q = np.zeros(12)
    q[ARM_Q] = (LOWER + UPPER) / 2
    return q


def test_a_small_velocity_passes_untouched():
    wanted = np.full(9, 1e-3)
    out = SATURATION.apply(wanted, middle(), np.zeros(9))
    np.testing.assert_array_equal(out.xi, wanted)
    assert out.scale == 1.0 and not out.braked


def test_a_large_velocity_keeps_its_direction():
    wanted = np.array([1.0, 1.0, 30.0, 0.5, 0, -0.4, 0, 0.2, 0.1])
    sent = np.zeros(9)
    for _ in range(200):
        out = SATURATION.apply(wanted, middle(), sent)
        sent = out.xi
    assert abs(sent[2]) <= SATURATION.velocity[2] + 1e-9
    np.testing.assert_allclose(sent / np.linalg.norm(sent), wanted / np.linalg.norm(wanted), atol=1e-9)
    assert 0 < out.scale < 0.1


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_whatever_is_wanted_no_limit_is_ever_broken(seed):
    """Random demands for three seconds, integrated: velocity, acceleration and position stay inside."""
    rng = np.random.default_rng(seed)
    q, sent = middle(), np.zeros(9)
    wanted = np.zeros(9)
    for i in range(300):
        if i % 40 == 0:
            wanted = rng.normal(0, 3, 9) * rng.choice([0.1, 1.0, 10.0])
        out = SATURATION.apply(wanted, q, sent)
        assert SATURATION.admits(out.xi, sent)
        sent = out.xi
        q[3:] += sent * DT
        assert (q[ARM_Q] > LOWER).all() and (q[ARM_Q] < UPPER).all()


def test_driving_at_a_joint_limit_comes_to_rest_before_it():
    q, sent = middle(), np.zeros(9)
    wanted = np.zeros(9)
    wanted[2 + 3] = 2.0
    for _ in range(600):
        sent = SATURATION.apply(wanted, q, sent).xi
        q[3:] += sent * DT
    assert 0.0 < UPPER[3] - q[8] < 0.06
    assert abs(sent[5]) < 1e-2


def test_a_joint_outside_its_limit_may_only_move_back():
    q = middle()
    q[8] = UPPER[3] + 0.05
    away, back = np.zeros(9), np.zeros(9)
    away[5], back[5] = 0.1, -0.1
    assert SATURATION.apply(away, q, np.zeros(9)).xi[5] <= 1e-9
    assert SATURATION.apply(back, q, np.zeros(9)).xi[5] < -1e-3


def test_ramp_and_brake_come_to_rest_within_the_acceleration():
    start = np.array([2.0, -2.0, 1.0, -1.0, 0.5, 0.2, 0.1, -0.3, 1.2])
    for slow in (SATURATION.ramp, SATURATION.brake):
        sent = start.copy()
        for _ in range(60):
            following = slow(sent)
            assert SATURATION.admits(following, sent)
            sent = following
        assert not sent.any()


def test_what_is_not_finite_is_not_admitted():
    for bad in (np.nan, np.inf, -np.inf):
        xi = np.zeros(9)
        xi[4] = bad
        assert not SATURATION.admits(xi, np.zeros(9))


def test_what_is_sent_keeps_the_rated_jerk():
    """At 1 kHz from speeding up to braking the change of acceleration takes its periods; what is in reach is sent."""
    saturation = Saturation(ROBOT, WholeBodyConfig(), 0.001)
    step, jerk = saturation.acceleration * 0.001, ROBOT.limits.jerk * 1e-6
    before, sent = np.zeros(9), step
    out = saturation.smooth(np.zeros(9), sent, before)
    np.testing.assert_allclose(out[2:], (sent + np.maximum(step - jerk, -step))[2:])
    np.testing.assert_array_equal(out[:2], [0.0, 0.0])
    near = sent + step - 0.5 * jerk
    np.testing.assert_allclose(saturation.smooth(near, sent, before)[2:], near[2:], atol=1e-15)
