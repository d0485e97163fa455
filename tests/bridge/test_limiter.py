import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.core.limiter import Limiter
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

LIMITS = RobotModel().limits
LOWER, UPPER = LIMITS.lower[ARM_Q], LIMITS.upper[ARM_Q]
DT = 0.001


def limiter() -> Limiter:
    return Limiter(LIMITS, 13.5, 0.01, DT)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.lists(st.floats(-1e6, 1e6), min_size=9, max_size=9), min_size=1, max_size=6),
    st.floats(0.05, 0.95),
)
def test_any_input_keeps_velocity_acceleration_jerk_and_joint_limits(goals: list[list[float]], where: float) -> None:
    bound, arm = limiter(), LOWER + where * (UPPER - LOWER)
    before, last = np.zeros(9), np.zeros(7)
    for goal in goals:
        for _ in range(400):
            sent = bound.step(np.array(goal), arm)
            assert np.all(np.abs(sent) <= LIMITS.velocity + 1e-12)
            assert np.all(np.abs(sent - before) <= LIMITS.acceleration * DT + 1e-12)
            assert np.all(np.abs(sent - before)[:2] <= 13.5 * DT + 1e-12)
            change = (sent - before)[ARM_XI]
            assert np.all(np.abs(change - last) <= LIMITS.jerk[ARM_XI] * DT**2 + 1e-12)
            before, last = sent, change
            arm = arm + sent[ARM_XI] * DT
            assert np.all((arm > LOWER) & (arm < UPPER))


def test_a_reachable_setpoint_is_sent_on_unchanged() -> None:
    bound, goal = limiter(), np.array([1.0, -1.0, 0.3, 0.2, 0.1, -0.1, 0.0, 0.1, -0.3])
    arm = (LOWER + UPPER) / 2
    for _ in range(200):
        sent = bound.step(goal, arm)
    assert np.array_equal(sent, goal)


def test_from_beyond_a_limit_a_joint_may_come_back() -> None:
    bound, arm = limiter(), UPPER + 0.05
    for _ in range(10):
        assert np.all(bound.step(np.full(9, 1.0), arm)[ARM_XI] <= 0.0)
    for _ in range(10):
        sent = bound.step(np.full(9, -1.0), arm)
    assert np.all(sent[ARM_XI] < 0.0)


def test_what_the_controller_may_send_a_thousand_times_a_second_is_sent_on_unchanged() -> None:
    """Half of the rated acceleration and jerk: the controller's shares."""
    bound, arm = limiter(), (LOWER + UPPER) / 2
    rng, sent, change = np.random.default_rng(0), np.zeros(9), np.zeros(7)
    most, jerk = 0.5 * LIMITS.acceleration[ARM_XI] * DT, 0.5 * LIMITS.jerk[ARM_XI] * DT**2
    for i in range(2000):
        if i % 20 == 0:
            ends = rng.choice([-1.0, 1.0], 7)
        change = np.clip(change + ends * jerk, -most, most)
        change = np.where(np.abs(sent[ARM_XI] + change) < 1.0, change, change - np.clip(change, -jerk, jerk))
        sent[ARM_XI] += change
        np.testing.assert_allclose(bound.step(sent, arm), sent, atol=1e-12)


def test_towards_a_limit_a_joint_is_as_fast_as_half_its_acceleration_can_still_stop() -> None:
    for away in (0.02, 0.1, 0.3):
        bound, arm = limiter(), UPPER - 0.01 - away
        for _ in range(1500):
            sent = bound.step(np.full(9, 1e6), arm)
        most = np.minimum(LIMITS.velocity[ARM_XI], np.sqrt(LIMITS.acceleration[ARM_XI] * away))
        np.testing.assert_allclose(sent[ARM_XI], most, rtol=1e-6)


def test_from_what_the_arm_took_it_goes_on_without_a_jerk() -> None:
    bound, arm = limiter(), (LOWER + UPPER) / 2
    velocity, change = np.full(7, 0.5), np.full(7, 2e-4)
    bound.go_on_from(velocity, change)
    sent = bound.step(np.zeros(9), arm)
    assert np.all(np.abs(sent[ARM_XI] - (velocity + change)) <= LIMITS.jerk[ARM_XI] * DT**2 + 1e-12)
    assert not sent[:2].any()


@pytest.mark.parametrize("repeats", [1, 20])
def test_where_packets_may_be_lost_the_arm_may_go_on_with_its_acceleration_and_stays_below_its_velocity(
    repeats: int,
) -> None:
    bound, arm = Limiter(LIMITS, 13.5, 0.01, DT, repeats), (LOWER + UPPER) / 2
    most, before = LIMITS.velocity[ARM_XI], np.zeros(7)
    for goal in (1e6, -1e6, 1e6):
        fastest = np.zeros(7)
        for _ in range(1500):
            sent = bound.step(np.full(9, goal), arm)[ARM_XI]
            change, before = sent - before, sent
            assert np.all(np.abs(sent + repeats * change) <= most + 1e-9)
            fastest = np.maximum(fastest, np.sign(goal) * sent)
        assert np.all(fastest > 0.9 * np.minimum(most, np.sqrt(LIMITS.acceleration[ARM_XI] * (UPPER - LOWER) / 2)))


def test_where_no_packet_is_lost_no_room_is_left_for_one() -> None:
    def periods(bound: Limiter) -> int:
        arm, goal = (LOWER + UPPER) / 2, np.full(9, 1e6)
        return next(i for i in range(2000) if np.all(bound.step(goal, arm)[ARM_XI] > 0.9999 * LIMITS.velocity[ARM_XI]))

    assert periods(limiter()) < periods(Limiter(LIMITS, 13.5, 0.01, DT, 1.0))


def test_after_a_standstill_it_goes_on_from_how_the_robot_moves_within_its_velocities() -> None:
    bound, arm = limiter(), (LOWER + UPPER) / 2
    bound.go_on_from(np.zeros(7), np.full(7, 2e-4))
    moving = np.array([1.0, -1.0, 0.3, -0.3, 99.0, -99.0, 0.0, 0.0, 0.1])
    bound.restart(moving)
    np.testing.assert_array_equal(bound.sent, np.clip(moving, -LIMITS.velocity, LIMITS.velocity))
    change = bound.step(bound.sent.copy(), arm) - np.clip(moving, -LIMITS.velocity, LIMITS.velocity)
    assert np.all(np.abs(change[ARM_XI]) <= LIMITS.jerk[ARM_XI] * DT**2 + 1e-12)


def test_braking_takes_as_long_as_that_of_the_slowest_actuator() -> None:
    wheels = np.array([-2.7, 1.35, *(0.0,) * 7])
    assert np.isclose(limiter().braking_s(wheels), 0.2)
    joint = np.array([0.0, 0.0, 1.0, *(0.0,) * 6])
    assert np.isclose(limiter().braking_s(joint), 1.0 / LIMITS.acceleration[2])
