"""What is left open is remembered per spur, with what it needs, until it is settled."""

from perception.plant.numbering import SpurNumber
from perception.plant.undecided_sites import UndecidedSites, undecided_site
from rolling_panda import reasons
from tests.support.points import point

ALIKE = reasons.canes_at_same_height()
FIRST, SECOND = SpurNumber(1, 1), SpurNumber(2, 1)


def because(*told, against=()):
    return [(frozenset(against), reason) for reason in told]


def points(number, *kinds):
    return [point("p1", (0.0, 0.0, 1.0), vine=number.vine, spur=number.spur, kind=kind) for kind in kinds]


def test_a_reason_says_whether_another_look_may_help_or_only_a_person():
    assert undecided_site(reasons.cut_place_hidden(), FIRST).needs == "another look"
    for cause, needs in ((reasons.stub_unclear(), "another look"), (reasons.cane_below_keeper(), "operator")):
        assert undecided_site(reasons.other_canes_left(2, cause), FIRST).needs == needs
    for_a_person = undecided_site(ALIKE, FIRST)
    assert (for_a_person.needs, for_a_person.vine, for_a_person.spur) == ("operator", 1, 1)


def test_what_a_spur_lacked_stays_told_while_others_are_looked_at_and_ends_when_it_is_settled():
    sites = UndecidedSites()
    sites.update(SECOND, False, because(ALIKE))
    sites.update(FIRST, False, because(reasons.cane_base_hidden()))
    open_sites = [(each.vine, each.reason) for each in sites.remaining(set())]
    assert open_sites == [
        (1, reasons.cane_base_hidden()),
        (2, ALIKE),
    ]
    sites.update(FIRST, True, because())
    assert [each.vine for each in sites.remaining(set())] == [2]
    sites.clear()
    assert sites.remaining(set()) == ()


def test_a_look_that_saw_too_little_is_not_told_of_a_spur_that_has_its_point():
    sites = UndecidedSites()
    sites.update(FIRST, False, because(reasons.cane_base_hidden()))
    assert sites.remaining(points(FIRST, "spur cut")) == () and len(sites.remaining(points(SECOND, "spur cut"))) == 1
    sites.update(FIRST, True, because(reasons.other_cane_left(reasons.cane_below_keeper())))
    assert len(sites.remaining(points(FIRST, "spur cut"))) == 1


def test_a_reason_against_a_cut_is_none_where_other_pictures_have_shown_that_cut():
    sites = UndecidedSites()
    lacking, unseen = reasons.nodes_lacking(7, 8), reasons.old_cane_unseen()
    sites.update(FIRST, True, [*because(lacking, against=("cane cut",)), *because(unseen, against=("removal",))])
    told = [
        sites.remaining(points(FIRST, *kinds)) for kinds in ((), ("cane cut",), ("removal",), ("cane cut", "removal"))
    ]
    assert [[each.reason for each in open_] for open_ in told] == [[lacking, unseen], [unseen], [lacking], []]
    assert len(sites.remaining(points(SECOND, "cane cut", "removal"))) == 2
    # A reason against two cuts is settled by both.
    sites.update(FIRST, True, because(lacking, against=("spur cut", "cane cut")))
    assert len(sites.remaining(points(FIRST, "cane cut"))) == 1
    assert not sites.remaining(points(FIRST, "cane cut", "spur cut"))


def test_what_was_seen_from_before_a_place_is_not_taken_back_from_aside():
    sites = UndecidedSites()
    sites.update(FIRST, False, because(reasons.spur_at_image_edge()), (1.0, 0.8, 0.9), in_front=False)
    sites.update(FIRST, False, because(ALIKE), (1.0, 0.8, 0.9))
    sites.update(FIRST, False, because(reasons.spur_at_image_edge()), (1.0, 0.8, 0.9), in_front=False)
    (told,) = sites.remaining(set())
    assert (told.reason, told.needs, told.position) == (ALIKE, "operator", (1.0, 0.8, 0.9))
    sites.update(FIRST, True, because(), in_front=False)
    assert sites.remaining(set()) == ()


def test_what_an_operator_leaves_needs_nothing_until_something_else_is_unclear_there():
    sites = UndecidedSites()
    assert not sites.leave(FIRST, True), "nothing is undecided there"
    sites.update(FIRST, False, because(reasons.nodes_lacking(0, 2)))
    sites.update(SECOND, False, because(ALIKE))
    assert sites.leave(FIRST, True)
    assert [each.needs for each in sites.remaining(set())] == ["nothing", "operator"]
    for _ in range(20):
        # Other numbers, and many looks, are no other matter.
        sites.update(FIRST, False, because(reasons.nodes_lacking(1, 2)))
    assert [each.needs for each in sites.remaining(set())] == ["nothing", "operator"]
    sites.update(FIRST, False, because(reasons.nodes_lacking(1, 2), ALIKE))
    assert [each.needs for each in sites.remaining(set())] == ["nothing", "operator", "operator"]
    assert sites.leave(FIRST, True) and sites.leave(FIRST, False)
    assert "nothing" not in [each.needs for each in sites.remaining(set())]
    sites.leave(SECOND, True)
    sites.clear()
    sites.update(SECOND, False, because(ALIKE))
    assert [each.needs for each in sites.remaining(set())] == ["operator"], "another rule asks again"


def test_looks_enough_from_before_a_place_leave_it_to_a_person():
    sites = UndecidedSites()
    for looks in range(1, 15):
        sites.update(FIRST, False, because(reasons.cane_base_hidden()))
        (told,) = sites.remaining(set())
        assert told.needs == ("another look" if looks < 12 else "operator")
    assert told.reason == reasons.looks_exhausted(reasons.cane_base_hidden(), 14)
    aside = UndecidedSites()
    for _ in range(30):
        aside.update(FIRST, False, because(reasons.spur_at_image_edge()), in_front=False)
    assert aside.remaining(set())[0].needs == "another look"
