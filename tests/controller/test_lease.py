import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.identity import Client
from controller.supervision.lease import LIFE_S, Lease
from rolling_panda import reasons

ADA, BOB, EVE = Client("a", "Ada"), Client("b", "Bob"), Client("e", "Eve")


def held():
    out = Lease()
    out.claim(ADA, 0.0)
    return out


def test_who_comes_first_holds_control():
    assert Lease().notice is None
    it = held()
    assert it.notice == reasons.control_given("Ada")
    assert it.held_by(ADA) and not it.held_by(BOB)
    it.claim(BOB, 0.1)
    assert it.held_by(ADA)
    assert it.refusal(ADA) is None
    assert it.refusal(BOB) == reasons.control_held("Ada")


def test_a_lease_lives_one_second_without_being_renewed():
    it = held()
    for tick in range(1, 10):
        it.renew({"a": tick / 3, "b": tick / 3})
        assert it.review(False, tick / 3) is None
    assert it.review(False, 3.0 + 0.99) is None
    lost = it.review(False, 3.0 + LIFE_S)
    assert lost == it.notice == reasons.control_lapsed("Ada", 1.0)
    assert it.holder is None and it.left(3.5) == 0.0
    # Who comes back has to take it again: nothing resumes by itself.
    it.renew({"a": 4.1})
    assert not it.held_by(ADA)


def test_it_lives_from_the_last_word_not_from_when_that_is_told():
    it = held()
    it.renew({"a": 0.4})
    it.renew({"a": 0.2})
    assert it.left(1.0) == pytest.approx(0.4)
    assert it.review(False, 1.41)


def test_others_do_not_renew_it():
    it = held()
    it.renew({"b": 0.9})
    assert it.review(True, 1.0)


def test_who_holds_control_has_it_already_and_takes_it_from_nobody():
    it = held()
    for confirmed in (False, True):
        assert it.take(ADA, confirmed) is None
        assert it.held_by(ADA) and it.next_holder is None


def test_taking_over_needs_a_confirmation_and_a_robot_at_rest():
    it = held()
    assert it.take(BOB, False) == reasons.control_unconfirmed("Ada")
    assert it.held_by(ADA)
    assert it.take(BOB, True) is None
    # From here on nobody moves it.
    assert not it.held_by(ADA) and not it.held_by(BOB)
    assert it.refusal(ADA) == it.refusal(BOB) == reasons.control_passes("Bob")
    it.renew({"a": 0.2, "b": 0.2})
    it.review(False, 0.2)
    assert not it.held_by(BOB)
    it.review(True, 0.3)
    assert it.held_by(BOB)
    assert it.notice == reasons.control_given_over("Bob", "Ada")


def test_who_takes_what_nobody_holds_follows_nobody():
    it = Lease()
    assert it.take(BOB, False) is None
    it.review(True, 0.1)
    assert it.notice == reasons.control_given("Bob")


def test_of_two_who_take_at_once_the_first_gets_it():
    it = held()
    assert it.take(BOB, True) is None
    assert it.take(EVE, True) == reasons.control_being_taken("Bob")
    it.review(True, 0.2)
    assert it.held_by(BOB)


def test_a_request_is_granted_by_the_holder_alone():
    it = held()
    assert it.grant(ADA) == reasons.control_not_requested()
    before = it.notice_number
    assert it.request(BOB, 0.1) is None
    assert (it.notice, it.notice_number) == (reasons.control_asked("Bob", "Ada"), before + 1)
    assert it.request(EVE, 0.1) == reasons.control_requested("Bob")
    assert it.request(ADA, 0.1) == reasons.control_yours()
    assert it.grant(BOB) == reasons.control_not_yours()
    assert it.grant(ADA) is None
    it.review(True, 0.2)
    assert it.held_by(BOB) and it.requested is None


def test_a_request_is_forgotten_in_time_and_both_are_told():
    it = Lease()
    it.claim(ADA, 100.0)
    it.request(BOB, 100.0)
    for tick in range(302):
        now = 100.0 + tick / 10
        it.renew({"a": now})
        it.review(True, now)
        assert it.held_by(ADA) and it.requested == (BOB if tick <= 300 else None)
        told = reasons.control_asked("Bob", "Ada") if tick <= 300 else reasons.control_unanswered("Bob", "Ada")
        assert it.notice == told


def test_control_is_given_back_by_its_holder():
    it = held()
    assert it.give_back(BOB) == reasons.control_not_yours()
    before = it.notice_number
    assert it.give_back(ADA) is None
    assert it.holder is None
    assert (it.notice, it.notice_number) == (reasons.control_returned("Ada"), before + 1)
    assert it.left(0.1) == 0.0
    assert it.review(True, 0.1) == reasons.control_returned("Ada")
    assert it.request(BOB, 0.1) == reasons.control_free()


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["claim", "take", "seize", "request", "grant", "return", "renew", "review"]),
            st.sampled_from([ADA, BOB, EVE]),
            st.floats(0.0, 0.7),
            st.booleans(),
        ),
        max_size=80,
    )
)
def test_there_is_never_more_than_one_holder(script):
    it, now, renewed = Lease(), 0.0, 0.0
    for act, client, wait, at_rest in script:
        now += wait
        before = it.holder
        match act:
            case "claim":
                it.claim(client, now)
            case "take":
                it.take(client, False)
            case "seize":
                it.take(client, True)
            case "request":
                it.request(client, now)
            case "grant":
                it.grant(client)
            case "return":
                it.give_back(client)
            case "renew":
                # The server tells of a word that may be up to a second old.
                it.renew({client.key: now - wait})
                if it.holder == client:
                    renewed = max(renewed, now - wait)
            case "review":
                it.review(at_rest, now)
                if it.holder is not None and it.holder == before:
                    assert now - renewed < LIFE_S
        if it.holder is not None and it.holder != before:
            renewed = now
            assert before is None or (act == "review" and at_rest)
        assert sum(it.held_by(each) for each in (ADA, BOB, EVE)) <= 1


@pytest.mark.parametrize("pair", [(ADA, BOB), (BOB, ADA)])
def test_a_thousand_times_two_operators_take_at_once_and_one_has_it(pair):
    for _ in range(1000):
        it = Lease()
        answers = [it.take(client, True) for client in pair]
        it.review(True, 0.0)
        assert answers.count(None) == 1 and it.held_by(pair[0]) and not it.held_by(pair[1])
