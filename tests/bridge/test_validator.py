import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.core import validator as f
from bridge.core import validator as g
from bridge.core.validator import CommandValidator, Fence
from rolling_panda.messages.robot import CutCommand, MotionCommand, TokenRequest
from rolling_panda.model.robot import RobotModel

LIMIT = RobotModel().limits.velocity
REST = (0.0,) * 9
MOVE = (1.0, 1.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def command(
    sequence: int, xi: tuple[float, ...] = MOVE, epoch: int = 1, echo: int = 1, token: str = "aa"
) -> MotionCommand:
    return MotionCommand(epoch=epoch, sequence=sequence, echo=echo, xi=xi, token=token)  # type: ignore[arg-type]


def cut(epoch: int = 1, echo: int = 1, token: str = "aa") -> CutCommand:
    return CutCommand(epoch=epoch, echo=echo, token=token, cut_id="c", point_id="p")


@pytest.fixture
def awake() -> CommandValidator:
    """A gate that has sent joint state 1 at t = 0 and has taken sequence 1 of epoch 1 at rest."""
    gate = CommandValidator(LIMIT, 0.2, Fence(1, "aa"))
    gate.sent(1, 0.0)
    assert gate.refuse(command(1, REST), 0.0) is None
    return gate


def test_a_fresh_newer_command_passes(awake: CommandValidator) -> None:
    assert awake.refuse(command(2), 0.1) is None
    assert awake.sequence == 2


@pytest.mark.parametrize(
    ("message", "now", "reason"),
    [
        (command(1), 0.1, g.OLD_SEQUENCE),
        (command(9, epoch=0), 0.1, f.OLD_EPOCH),
        (command(9, token="bb"), 0.1, f.OTHER_TOKEN),
        (command(9, epoch=2), 0.1, f.UNKNOWN_EPOCH),
        (command(9, REST, epoch=2, token="bb"), 0.1, f.UNKNOWN_EPOCH),
        (command(2), 0.21, g.TOO_OLD),
        (command(2, echo=7), 0.1, g.UNSENT_ECHO),
        (command(2, (math.nan, *REST[1:])), 0.1, g.NOT_FINITE),
        (command(2, (*REST[1:], math.inf)), 0.1, g.NOT_FINITE),
        (command(2, (float(LIMIT[0]) * 1.001, *REST[1:])), 0.1, g.TOO_FAST),
    ],
)
def test_a_refused_command_changes_nothing(
    awake: CommandValidator, message: MotionCommand, now: float, reason: str
) -> None:
    assert awake.refuse(message, now) == reason
    assert awake.sequence == 1
    assert awake.refuse(command(2), 0.1) is None


def request(token: str = "bb", echo: int = 2) -> TokenRequest:
    return TokenRequest(token=token, echo=echo, mode="IDLE")


def test_a_new_controller_starts_its_sequence_again_at_rest_and_silences_the_old_one(awake: CommandValidator) -> None:
    assert awake.refuse(command(500), 0.1) is None
    awake.sent(2, 1.2)
    assert awake.claim(request(), 1.2, at_rest=True) is None
    assert awake.refuse(command(501, echo=2), 1.2) == f.OLD_EPOCH
    assert awake.refuse(command(1, epoch=2, token="bb", echo=2), 1.2) == g.NOT_AT_REST
    assert awake.refuse(command(1, REST, epoch=2, token="bb", echo=2), 1.2) is None
    assert awake.refuse(command(2, epoch=2, token="bb", echo=2), 1.2) is None


def test_who_asks_again_goes_on_with_its_sequence(awake: CommandValidator) -> None:
    assert awake.refuse(command(5), 0.1) is None
    assert awake.claim(request("aa", 1), 0.1, at_rest=False) is None
    assert awake.refuse(command(5), 0.1) == g.OLD_SEQUENCE
    assert awake.refuse(command(6), 0.1) is None


def test_a_request_that_was_long_on_its_way_is_given_nothing(awake: CommandValidator) -> None:
    assert awake.claim(request(echo=1), 9.0, at_rest=True) == g.TOO_OLD
    assert awake.claim(request(echo=7), 9.0, at_rest=True) == g.UNSENT_ECHO


def test_a_cut_needs_the_token_and_a_fresh_view(awake: CommandValidator) -> None:
    assert awake.refuse_cut(cut(), 0.1) is None
    assert awake.refuse_cut(cut(epoch=0), 0.1) == f.OLD_EPOCH
    assert awake.refuse_cut(cut(epoch=2), 0.1) == f.UNKNOWN_EPOCH
    assert awake.refuse_cut(cut(token="bb"), 0.1) == f.OTHER_TOKEN
    assert awake.refuse_cut(cut(echo=2), 0.1) == g.UNSENT_ECHO
    assert awake.refuse_cut(cut(), 0.21) == g.TOO_OLD


def test_exactly_the_limit_passes(awake: CommandValidator) -> None:
    assert awake.refuse(command(2, tuple(float(v) for v in LIMIT)), 0.1) is None


def test_after_a_standstill_only_rest_wakes(awake: CommandValidator) -> None:
    awake.require_rest()
    assert awake.refuse(command(2), 0.1) == g.NOT_AT_REST
    assert awake.refuse(command(3, REST), 0.1) is None
    assert awake.refuse(command(4), 0.1) is None


def test_a_state_sent_long_ago_is_too_old_and_not_unknown() -> None:
    gate = CommandValidator(LIMIT, 0.2, Fence(1, "aa"))
    for sequence in range(1, 1000):
        gate.sent(sequence, sequence * 0.01)
    assert gate.refuse(command(1, REST, echo=1), 9.99) == g.TOO_OLD


def test_after_a_start_of_the_bridge_a_known_token_wakes_nothing_but_at_rest() -> None:
    gate = CommandValidator(LIMIT, 0.2, Fence(1, "aa"))
    gate.sent(1, 0.0)
    assert gate.refuse(command(1), 0.1) == g.NOT_AT_REST
    assert gate.refuse(command(2, REST), 0.1) is None
    assert gate.refuse(command(3), 0.1) is None


def test_before_any_joint_state_was_sent_every_echo_is_unknown() -> None:
    gate = CommandValidator(LIMIT, 0.2, Fence(1, "aa"))
    assert gate.refuse(command(1, REST, echo=0), 0.0) == g.UNSENT_ECHO


def test_of_very_many_joint_states_the_last_two_thousand_are_remembered_whatever_age_is_allowed() -> None:
    def answered(sent: int, echo: int) -> str | None:
        gate = CommandValidator(LIMIT, 1e9, Fence(1, "aa"))
        for number in range(1, sent + 1):
            gate.sent(number, number * 1e-3)
        return gate.refuse(command(1, REST, echo=echo), 9.0)

    assert answered(2000, 1) is None
    assert answered(2001, 1) == g.TOO_OLD
    assert answered(2001, 2) is None and answered(2001, 2001) is None


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 3),
            st.integers(0, 12),
            st.integers(0, 12),
            st.lists(st.floats(-12.0, 12.0) | st.sampled_from([math.nan, math.inf, 1e308]), min_size=9, max_size=9),
            st.floats(0.0, 0.1),
        ),
        max_size=40,
    )
)
def test_whatever_comes_what_passes_is_newer_fresh_and_within_limits(
    stream: list[tuple[int, int, int, list[float], float]],
) -> None:
    gate = CommandValidator(LIMIT, 0.2, Fence(1, "aa"))
    sent: dict[int, float] = {}
    passed = [(1, -1)]
    now = 0.0
    for tick, (epoch, sequence, echo, xi, wait) in enumerate(stream):
        now += wait
        if tick % 3 == 0:
            sent[tick // 3] = now
            gate.sent(tick // 3, now)
        resting = gate.must_rest
        if gate.refuse(command(sequence, tuple(xi), epoch, echo), now) is None:
            assert (epoch, sequence) > passed[-1]
            assert now - sent[echo] <= 0.2
            assert np.all(np.abs(xi) <= LIMIT * (1 + 1e-6))
            assert not resting or np.all(np.abs(xi) < 2e-3)
            passed.append((epoch, sequence))
