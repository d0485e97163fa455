import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.real.arm_follower import TICK_S, ArmFollower
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

LIMITS = RobotModel().limits
V, A, J = LIMITS.velocity[ARM_XI], LIMITS.acceleration[ARM_XI], LIMITS.jerk[ARM_XI]
MIDDLE = (LIMITS.lower[ARM_Q] + LIMITS.upper[ARM_Q]) / 2


class Arm:
    """An arm that takes every command, or guesses it by its last acceleration when told that it got lost."""

    def __init__(self) -> None:
        self.follower = ArmFollower(LIMITS, 0.01, 0.07, 0.2)
        self.now, self.q, self.dq, self.ddq = 10.0, MIDDLE.copy(), np.zeros(7), np.zeros(7)
        self.taken: list[np.ndarray] = []
        self.worst = 0.0

    def run(self, ticks: int, lost: bool = False, late_s: float = 0.0) -> None:
        """So many of its milliseconds, each of which takes `late_s` longer by the clock."""
        for _ in range(ticks):
            self.now += TICK_S + late_s
            dq = self.follower.step(self.now, self.q, self.dq, self.ddq).copy()
            if lost:
                dq = self.dq + self.ddq * TICK_S
            ddq = (dq - self.dq) / TICK_S
            shares = [np.abs(dq) / V, np.abs(ddq) / A, np.abs(ddq - self.ddq) / TICK_S / J]
            self.worst = max(self.worst, *(float(share.max()) for share in shares))
            self.q, self.dq, self.ddq = self.q + 0.5 * (self.dq + dq) * TICK_S, dq, ddq
            self.taken.append(dq)


def test_a_stairway_of_targets_becomes_the_slope_that_was_meant() -> None:
    arm = Arm()
    for k in range(1, 41):
        arm.follower.aim(np.full(7, 0.01 * k), arm.now)
        arm.run(5)
    slope = np.diff(np.array(arm.taken)[60:, 0]) / TICK_S
    assert slope.mean() == pytest.approx(2.0, rel=0.05)
    assert slope.min() > 1.0
    assert slope.max() < 3.0


def test_it_comes_to_rest_within_its_deadline_when_no_target_comes() -> None:
    arm = Arm()
    for _ in range(100):
        arm.follower.aim(np.full(7, 0.3), arm.now)
        arm.run(5)
    assert arm.dq == pytest.approx(np.full(7, 0.3))
    arm.run(300)
    assert np.abs(arm.dq).max() < 1e-9


def test_a_target_after_silence_does_not_wake_the_one_before_it() -> None:
    arm = Arm()
    for _ in range(100):
        arm.follower.aim(np.full(7, 0.3), arm.now)
        arm.run(5)
    arm.run(500)
    arm.taken.clear()
    for _ in range(20):
        arm.follower.aim(np.zeros(7), arm.now)
        arm.run(5)
    assert np.abs(arm.taken).max() == 0.0


def test_it_holds_when_told_to_whatever_the_target_is() -> None:
    arm = Arm()
    arm.follower.aim(np.full(7, 0.3), arm.now)
    for _ in range(200):
        arm.now += TICK_S
        arm.follower.aim(np.full(7, 0.3), arm.now)
        assert np.abs(arm.follower.step(arm.now, arm.q, arm.dq, arm.ddq, hold=True)).max() == 0.0


speeds = st.one_of(st.sampled_from([-4.0, 4.0]), st.floats(-4.0, 4.0))
periods = st.tuples(
    st.lists(speeds, min_size=7, max_size=7),
    st.one_of(st.integers(1, 40), st.integers(150, 320)),
    st.sampled_from([0, 0, 1, 5, 19]),
    st.sampled_from([0.0, 0.0, 0.0004, 0.009, 0.03]),
    st.sampled_from([0.0, 0.003, 0.05, 0.3]),
)


@pytest.mark.long
@settings(max_examples=30)
@given(st.lists(periods, max_size=12))
def test_whatever_is_aimed_at_and_lost_or_late_no_limit_is_broken(
    script: list[tuple[list[float], int, int, float, float]],
) -> None:
    arm = Arm()
    for target, ticks, lost, late_s, old_s in script:
        arm.follower.aim(np.array(target), arm.now - old_s)
        arm.run(ticks, late_s=late_s)
        arm.run(lost, lost=True, late_s=late_s)
    arm.run(400)
    assert arm.worst <= 1.0
    assert np.abs(arm.dq).max() < 1e-9


@pytest.mark.parametrize("ticks", range(130, 300, 3))
def test_as_many_lost_packets_as_there_may_be_carry_no_joint_beyond_its_velocity(ticks: int) -> None:
    """Two rows of them with one command in between, in the middle of speeding up and close to the highest speed."""
    arm = Arm()
    for _ in range(ticks):
        arm.follower.aim(np.full(7, 4.0), arm.now)
        arm.run(1)
    for _ in range(2):
        arm.run(19, lost=True)
        arm.run(1)
    arm.run(50)
    assert arm.worst <= 1.0


def test_without_lost_packets_it_comes_to_the_highest_speed() -> None:
    arm = Arm()
    for _ in range(600):
        arm.follower.aim(np.full(7, 4.0), arm.now)
        arm.q = MIDDLE.copy()
        arm.run(1)
    assert np.min(arm.dq / V) > 0.99
