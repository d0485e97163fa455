import pytest

from server.auth.sessions import Session
from server.robots.presence import PresenceTracker


def session(user="ann", role="operator"):
    return Session("cookie of " + user, user, role, 0.0)


def test_who_says_something_is_there_for_a_second():
    presence, ann = PresenceTracker(), session()
    assert presence.message(0.0).people == ()
    presence.on_activity(ann, 1.0)
    (person,) = presence.message(1.9).people
    assert (person.key, person.user, person.role) == (ann.client, "ann", "operator")
    assert presence.message(2.1).people == ()


def test_the_age_of_the_last_word_is_told_and_the_first_one_after_a_silence_is_news():
    presence, ann, vic = PresenceTracker(), session(), session("vic", "viewer")
    assert presence.on_activity(ann, 1.0)
    assert presence.message(1.7).people[0].heard_age_s == pytest.approx(0.7)
    assert presence.on_activity(ann, 1.7)
    assert not presence.on_activity(ann, 1.75)
    assert presence.message(1.8).people[0].heard_age_s == pytest.approx(0.05)
    # Nobody waits for a viewer, of whom there may be many.
    assert not presence.on_activity(vic, 1.8)


def test_the_age_of_the_view_is_that_of_the_newest_state_drawn():
    presence, ann = PresenceTracker(), session()
    presence.on_activity(ann, 5.0)
    assert presence.message(5.0).people[0].view_age_s == 1e6
    presence.on_seen(ann, 4.8)
    presence.on_seen(ann, 4.5)
    assert presence.message(5.0).people[0].view_age_s == pytest.approx(0.2)


def test_numbers_grow_and_who_leaves_is_forgotten_at_once():
    presence, ann = PresenceTracker(), session()
    presence.on_activity(ann, 1.0)
    first = presence.message(1.0)
    presence.forget(ann)
    second = presence.message(1.0)
    assert second.sequence > first.sequence and second.people == ()


def test_two_of_the_same_name_are_told_apart_and_the_cookie_is_not_told():
    presence, one, two = PresenceTracker(), session(), session()
    presence.on_activity(one, 1.0)
    presence.on_activity(two, 1.0)
    keys = {person.key for person in presence.message(1.0).people}
    assert len(keys) == 2 and not any("cookie" in key for key in keys)


def test_the_first_look_in_a_while_is_news_and_the_next_ones_are_not():
    presence, ann = PresenceTracker(), session()
    presence.on_activity(ann, 1.0)
    assert presence.on_seen(ann, 0.9)
    assert not presence.on_seen(ann, 1.4)
    assert presence.on_seen(ann, 9.0)
    assert not presence.on_seen(ann, 8.0)
