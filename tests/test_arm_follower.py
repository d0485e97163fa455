import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.real.arm_follower import TICK_S, ArmFollower
from rolling_panda.robot_model import ARM_Q, ARM_XI, RobotModel

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

    def run(self, ticks: int, lost: bool = False) -> None:
        for _ in range(ticks):
            self.now += TICK_S
            dq = self.follower.step(self.now, self.q, self.dq, self.ddq).copy()
            if lost:
                dq = np.clip(self.dq + self.ddq * TICK_S, -V, V)
            ddq = (dq - self.dq) / TICK_S
            if not lost:
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


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.lists(st.floats(-4.0, 4.0), min_size=7, max_size=7),
            st.integers(1, 40),
            st.sampled_from([0, 0, 0, 1, 5, 19]),
        ),
        max_size=25,
    )
)
def test_whatever_is_aimed_at_and_lost_no_limit_is_broken(script: list[tuple[list[float], int, int]]) -> None:
    arm = Arm()
    for target, ticks, lost in script:
        arm.follower.aim(np.array(target), arm.now)
        arm.run(ticks)
        arm.run(lost, lost=True)
    arm.run(400)
    assert arm.worst <= 1.0 + 1e-9
    assert np.abs(arm.dq).max() < 1e-9
