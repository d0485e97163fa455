"""What is left open is remembered per spur, with what it needs, until it is settled."""

from perception.plant.numbering import SpurNumber
from perception.plant.undecided_sites import MoreToSee, OpenPlaces, abstention

FIRST, SECOND = SpurNumber(1, 1), SpurNumber(2, 1)


def test_a_reason_says_whether_another_look_may_help_or_only_a_person():
    assert abstention(MoreToSee("the place is hidden"), FIRST).needs == "another look"
    for_a_person = abstention("two canes are alike", FIRST)
    assert (for_a_person.needs, for_a_person.vine, for_a_person.spur) == ("operator", 1, 1)


def test_what_a_spur_lacked_stays_told_while_others_are_looked_at_and_ends_when_it_is_settled():
    places = OpenPlaces()
    places.note(SECOND, False, ["two canes are alike"])
    places.note(FIRST, False, [MoreToSee("hidden")])
    assert [(each.vine, each.reason) for each in places.told(set())] == [(1, "hidden"), (2, "two canes are alike")]
    places.note(FIRST, True, [])
    assert [each.vine for each in places.told(set())] == [2]
    places.clear()
    assert places.told(set()) == ()


def test_a_look_that_saw_too_little_is_not_told_of_a_spur_that_has_its_point():
    places = OpenPlaces()
    places.note(FIRST, False, [MoreToSee("hidden")])
    assert places.told({FIRST}) == () and len(places.told({SECOND})) == 1
    places.note(FIRST, True, ["the other cane is left for a person"])
    assert len(places.told({FIRST})) == 1


def test_what_was_seen_from_before_a_place_is_not_taken_back_from_aside():
    places = OpenPlaces()
    places.note(FIRST, False, [MoreToSee("at the edge")], (1.0, 0.8, 0.9), before=False)
    places.note(FIRST, False, ["two canes are alike"], (1.0, 0.8, 0.9))
    places.note(FIRST, False, [MoreToSee("at the edge")], (1.0, 0.8, 0.9), before=False)
    (told,) = places.told(set())
    assert (told.reason, told.needs, told.position) == ("two canes are alike", "operator", (1.0, 0.8, 0.9))
    places.note(FIRST, True, [], before=False)
    assert places.told(set()) == ()


def test_looks_enough_from_before_a_place_leave_it_to_a_person():
    places = OpenPlaces()
    for looks in range(1, 15):
        places.note(FIRST, False, [MoreToSee("its base is hidden")])
        (told,) = places.told(set())
        assert told.needs == ("another look" if looks < 12 else "operator")
    assert told.reason == "its base is hidden; 14 looks from before it have not shown more: look yourself"
    aside = OpenPlaces()
    for _ in range(30):
        aside.note(FIRST, False, [MoreToSee("at the edge")], before=False)
    assert aside.told(set())[0].needs == "another look"
