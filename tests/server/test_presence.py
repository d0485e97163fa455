import pytest

from server.auth.sessions import Session
from server.robots.presence import PresentPeople


def session(user="ann", role="operator"):
    return Session("cookie of " + user, user, role, 0.0)


def test_who_says_something_is_there_for_a_second():
    people, ann = PresentPeople(), session()
    assert people.message(0.0).people == ()
    people.heard(ann, 1.0)
    (person,) = people.message(1.9).people
    assert (person.key, person.user, person.role) == (ann.client, "ann", "operator")
    assert people.message(2.1).people == ()


def test_the_age_of_the_last_word_is_told_and_the_first_one_after_a_silence_is_news():
    people, ann, vic = PresentPeople(), session(), session("vic", "viewer")
    assert people.heard(ann, 1.0)
    assert people.message(1.7).people[0].heard_age_s == pytest.approx(0.7)
    assert people.heard(ann, 1.7)
    assert not people.heard(ann, 1.75)
    assert people.message(1.8).people[0].heard_age_s == pytest.approx(0.05)
    # Nobody waits for a viewer, of whom there may be many.
    assert not people.heard(vic, 1.8)


def test_the_age_of_the_view_is_that_of_the_newest_state_drawn():
    people, ann = PresentPeople(), session()
    people.heard(ann, 5.0)
    assert people.message(5.0).people[0].view_age_s == 1e6
    people.saw(ann, 4.8)
    people.saw(ann, 4.5)
    assert people.message(5.0).people[0].view_age_s == pytest.approx(0.2)


def test_numbers_grow_and_who_leaves_is_forgotten_at_once():
    people, ann = PresentPeople(), session()
    people.heard(ann, 1.0)
    first = people.message(1.0)
    people.forget(ann)
    second = people.message(1.0)
    assert second.sequence > first.sequence and second.people == ()


def test_two_of_the_same_name_are_told_apart_and_the_cookie_is_not_told():
    people, one, two = PresentPeople(), session(), session()
    people.heard(one, 1.0)
    people.heard(two, 1.0)
    keys = {person.key for person in people.message(1.0).people}
    assert len(keys) == 2 and not any("cookie" in key for key in keys)


def test_the_first_look_in_a_while_is_news_and_the_next_ones_are_not():
    people, ann = PresentPeople(), session()
    people.heard(ann, 1.0)
    assert people.saw(ann, 0.9)
    assert not people.saw(ann, 1.4)
    assert people.saw(ann, 9.0)
    assert not people.saw(ann, 8.0)
