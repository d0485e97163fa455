import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rolling_panda import reasons
from rolling_panda.errors import InputError
from server.auth.sessions import Sessions, SignInError


def test_a_link_signs_in_once():
    sessions = Sessions(60.0)
    token = sessions.invite("ann", "operator")
    session = sessions.sign_in(token, 0.0)
    assert (session.user, session.role) == ("ann", "operator")
    with pytest.raises(SignInError, match="used"):
        sessions.sign_in(token, 1.0)


def test_secrets_are_long_and_differ():
    sessions = Sessions(60.0)
    tokens = {sessions.invite("ann", "viewer") for _ in range(20)}
    assert len(tokens) == 20
    assert min(len(token) for token in tokens) >= 43
    with pytest.raises(InputError, match="128 bits"):
        sessions.admit("x" * 21, "ann", "viewer")
    sessions.admit("x" * 22, "ann", "viewer")
    assert sessions.sign_in("x" * 22, 0.0).user == "ann"


def test_an_invitation_expires():
    sessions = Sessions(60.0)
    late, in_time = (sessions.invite("ann", "viewer", expires_at=10.0) for _ in range(2))
    assert sessions.sign_in(in_time, 10.0).user == "ann"
    with pytest.raises(SignInError):
        sessions.sign_in(late, 10.1)


def test_bad_attempts_cost_more_and_more_time_and_a_good_one_ends_that():
    sessions = Sessions(60.0)
    good = sessions.invite("ann", "viewer")
    for _ in range(5):
        with pytest.raises(SignInError) as caught:
            sessions.sign_in("wrong", 0.0)
    assert caught.value.wait_s == 0.0
    with pytest.raises(SignInError) as caught:
        sessions.sign_in("wrong", 0.5)
    # Nobody is told to wait for less than a second.
    assert caught.value.reason == reasons.sign_in_throttled(1.0)
    assert caught.value.wait_s == pytest.approx(0.5)
    with pytest.raises(SignInError):
        sessions.sign_in("wrong", 1.0)
    with pytest.raises(SignInError) as caught:
        sessions.sign_in("wrong", 1.0)
    assert caught.value.reason.code == "sign_in_throttled"
    assert caught.value.wait_s == pytest.approx(2.0)
    sessions.sign_in(good, 3.0)
    with pytest.raises(SignInError) as caught:
        sessions.sign_in("wrong", 3.0)
    assert caught.value.reason.code == "sign_in_link_void"


def test_an_idle_session_ends_and_a_used_one_does_not():
    sessions = Sessions(60.0)
    session = sessions.sign_in(sessions.invite("ann", "viewer"), 0.0)
    for now in (50.0, 100.0, 150.0):
        assert sessions.find(session.session_id, now) is session
    assert sessions.find(session.session_id, 211.0) is None
    assert session.ended.is_set()


def test_a_session_that_was_ended_is_gone():
    sessions = Sessions(60.0)
    session = sessions.sign_in(sessions.invite("ann", "viewer"), 0.0)
    sessions.end(session)
    sessions.end(session)
    assert sessions.find(session.session_id, 0.0) is None
    assert sessions.active() == ()


def test_sessions_of_removed_and_changed_accounts_are_void_and_those_of_links_are_not():
    sessions = Sessions(60.0)
    by_link = sessions.sign_in(sessions.invite("ann", "viewer"), 0.0)
    same, changed, removed = (sessions.open(name, "operator", 0.0, f"{name} 1") for name in ("ada", "bob", "eve"))
    assert sessions.void({"ada": "ada 1", "bob": "bob 2"}) == (changed, removed)
    assert sessions.void({}) == (same, changed, removed)
    assert by_link in sessions.active()


def test_a_good_sign_in_makes_bad_ones_of_that_address_be_forgotten():
    sessions = Sessions(60.0)
    for round_ in range(3):
        for _ in range(4):
            with pytest.raises(SignInError) as caught:
                sessions.sign_in("wrong", 0.0, "10.0.0.1")
            assert caught.value.wait_s == 0.0, round_
        sessions.sign_in(sessions.invite("ann", "viewer"), 0.0, "10.0.0.1")


def test_who_guesses_at_one_address_keeps_nobody_else_waiting():
    sessions = Sessions(60.0)
    for _ in range(5):
        with pytest.raises(SignInError):
            sessions.sign_in("wrong", 0.0, "10.0.0.1")
    good = sessions.invite("ann", "viewer")
    with pytest.raises(SignInError) as caught:
        sessions.sign_in(good, 0.5, "10.0.0.1")
    assert caught.value.reason.code == "sign_in_throttled"
    assert sessions.sign_in(good, 0.5, "10.0.0.2").user == "ann"


@settings(max_examples=50)
@given(st.text())
@example("\ud800 cannot be encoded")
def test_no_guess_is_a_session(guess):
    sessions = Sessions(60.0)
    sessions.sign_in(sessions.invite("ann", "viewer"), 0.0)
    assert sessions.find(guess, 0.0) is None
