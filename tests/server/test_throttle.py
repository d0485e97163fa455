"""Whoever guesses waits longer and longer, under every name and from every address."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.auth.throttle import FREE, MAX_DELAY_S, LoginThrottle


def test_five_are_free_then_the_delay_doubles_to_its_end():
    attempts, now, waits = LoginThrottle(), 0.0, []
    for _ in range(15):
        now += attempts.wait(("a",), now)
        attempts.failed(("a",), now)
        waits.append(attempts.wait(("a",), now))
    assert waits[: FREE - 1] == [0.0] * (FREE - 1)
    assert waits[FREE - 1 : FREE + 6] == pytest.approx([1, 2, 4, 8, 16, 32, 60])
    assert waits[-1] == pytest.approx(MAX_DELAY_S)


def test_any_of_the_keys_makes_wait_and_others_do_not():
    attempts = LoginThrottle()
    for _ in range(FREE):
        attempts.failed(("name ada", "address 1"), 0.0)
    assert attempts.wait(("name ada", "address 2"), 0.0) > 0.0
    assert attempts.wait(("name bob", "address 1"), 0.0) > 0.0
    assert attempts.wait(("name bob", "address 2"), 0.0) == 0.0


def test_a_good_attempt_ends_it():
    attempts = LoginThrottle()
    for _ in range(FREE - 1):
        attempts.failed(("a",), 0.0)
    attempts.succeeded(("a", "b"))
    attempts.failed(("a",), 0.0)
    assert attempts.wait(("a",), 0.0) == 0.0


def test_a_million_names_do_not_fill_the_memory():
    attempts = LoginThrottle()
    for _ in range(FREE):
        attempts.failed(("the first",), 0.0)
    assert attempts.wait(("the first",), 0.0) > 0.0
    for number in range(10_000):
        attempts.failed((f"name {number}", "address 1"), 0.0)
    assert attempts.wait(("the first",), 0.0) == 0.0, "the oldest is forgotten"
    assert attempts.wait(("address 1",), 0.0) > 0.0


def test_who_goes_on_guessing_is_not_forgotten_among_others():
    attempts = LoginThrottle()
    for block in range(3):
        for _ in range(FREE):
            attempts.failed(("name ada",), 0.0)
        for number in range(5_000):
            attempts.failed((f"name {block} {number}",), 0.0)
    assert attempts.wait(("name ada",), 0.0) == MAX_DELAY_S


@given(st.lists(st.floats(0.0, 100.0)))
def test_never_more_guesses_than_the_delays_allow(gaps):
    attempts, now, made = LoginThrottle(), 0.0, 0
    for gap in gaps:
        now += gap
        if attempts.wait(("a",), now) <= 0.0:
            attempts.failed(("a",), now)
            made += 1
    # FREE at once, then after 1, 2, 4, … s.
    allowed, spent, delay = FREE, 0.0, 1.0
    while spent + delay <= now + 1e-6:
        spent, delay, allowed = spent + delay, min(2 * delay, MAX_DELAY_S), allowed + 1
    assert made <= allowed
