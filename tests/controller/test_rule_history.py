"""Acceptances that another pruning rule makes void: the rows say so, and they come back when it is taken back."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.config import WorkConfig
from controller.ledger.journal import Journal
from controller.ledger.start import restored
from controller.ledger.store import Ledger
from controller.ledger.writer import _entry
from controller.work.point_queue import PointQueue
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import point_digest
from tests.controller.test_point_queue import point, state

USUAL, SHORT, LONG = m.PruningRule(), m.PruningRule(nodes_kept=1), m.PruningRule(nodes_kept=3)


def shown(*points, rule=USUAL, frames=1):
    return m.PruningPoints(header=m.Header(), segmenter="none", frames=frames, points=points, rule=rule)


def revised(name, x, revision):
    new = point(name, revision=revision, position=(x, 0.85, 1.0))
    return msgspec.structs.replace(new, digest=point_digest(new))


A, B, C = (revised(name, x, 3) for name, x in (("a", 1.0), ("b", 2.0), ("c", 3.0)))
A_SHORT = revised("a", 0.96, 4)
D = revised("d", 2.5, 1)


def accepted(*names):
    q = PointQueue(WorkConfig())
    q.update(shown(A, B, C))
    for name in names:
        assert q.accept(name, 3, "ada") is None
    return q


def test_rows_name_the_rule_as_the_cause():
    q = accepted("a", "b", "c")
    voided = q.update(shown(A_SHORT, C, D, rule=SHORT))
    assert len(voided) == 2
    why, rule = {e.point_id: e.reason for e in q.entries()}, reasons.spur_rule(1, 6.0, 20.0)
    ((_, cause),) = why["a"].values
    assert why["a"].code == "acceptance_void" and cause.code == "rule_cuts_elsewhere"
    assert dict(cause.values) == {"rule": rule, "distance_mm": pytest.approx(40.0)}
    assert why["b"] == reasons.acceptance_void(reasons.rule_wants_no_cut(rule))
    assert state(q, "c") == "ACCEPTED", "what the rule leaves as it is stays accepted"


def test_what_moves_less_than_a_point_may_move_is_void_by_a_rule_all_the_same():
    q = accepted("a")
    q.update(shown(revised("a", 1.004, 4), B, C, rule=m.PruningRule(offset=0.024)))
    (why,) = (value for _, value in q.get("a").reason.values)
    assert state(q) == "PROPOSED" and why.code == "rule_cuts_elsewhere"
    assert dict(why.values)["distance_mm"] == pytest.approx(4.0)


def test_a_rule_is_taken_back_with_its_acceptances_whoever_is_heard_first():
    for perception_first in (False, True):
        q = accepted("a", "b")
        before = {ticket.point.point_id: ticket for ticket in q.tickets()}
        q.update(shown(A_SHORT, C, rule=SHORT))
        if perception_first:
            q.update(shown(A, B, C))
            assert q.count("ACCEPTED") == 0, "nobody has said so yet"
            assert q.undo_rule(SHORT) is None
        else:
            assert q.undo_rule(SHORT) is None
            assert q.count("ACCEPTED") == 0, "the points are not back yet"
            q.update(shown(A, B, C))
        assert {ticket.point.point_id: ticket for ticket in q.tickets()} == before
        assert q.restored() == reasons.acceptances_restored("a, b") and q.restored() is None
        assert q.undo_rule(SHORT) == reasons.nothing_to_restore(), "once"


def test_setting_the_former_numbers_is_not_taking_back():
    q = accepted("a")
    q.update(shown(A_SHORT, B, C, rule=SHORT))
    q.update(shown(A, B, C))
    assert state(q) == "PROPOSED" and q.next() is None


def test_what_somebody_has_decided_since_or_is_elsewhere_stays_as_it_is():
    q = accepted("a", "b", "c")
    q.update(shown(A_SHORT, rule=SHORT))
    assert q.reject("a", "eve", "wrong cane") is None
    assert q.undo_rule(SHORT) is None
    q.update(shown(A, msgspec.structs.replace(revised("b", 2.0, 4), cane=1)))
    assert [state(q, name) for name in "abc"] == ["REJECTED", "PROPOSED", "PROPOSED"]
    assert q.restored() is None


def test_perception_that_starts_anew_is_no_change_of_the_rule():
    q = accepted("a")
    q.update(shown(A, B, C, frames=9))
    q.update(shown(rule=SHORT, frames=1))
    assert q.get("a").reason == reasons.acceptance_void(reasons.no_longer_reported())
    q.update(shown(A, rule=SHORT, frames=2))
    assert q.undo_rule(SHORT) == reasons.nothing_to_restore() and state(q) == "PROPOSED"


def test_the_ledger_has_the_acceptance_again_as_it_was(tmp_path):
    q = PointQueue(WorkConfig(), journal := Journal())
    q.update(shown(A, B, C))
    q.accept("a", 3, "ada")
    q.update(shown(A_SHORT, B, C, rule=SHORT))
    q.undo_rule(SHORT)
    q.update(shown(A, B, C))
    with Ledger(tmp_path) as ledger:
        ledger.append(_entry("2026-11-22T08:00:00+00:00", record) for record in journal.drain())
    rows = {row.point.point_id: row for row in restored(tmp_path).tickets}
    assert (rows["a"].state, rows["a"].user, rows["a"].accepted) == ("ACCEPTED", "ada", A)
    anew = PointQueue(WorkConfig())
    anew.restore(rows.values())
    anew.update(shown(A, B, C))
    assert anew.next().accepted == A


POINTS = {"a": (A, A_SHORT), "b": (B, revised("b", 2.03, 5)), "c": (C, C), "e": (revised("e", 4.0, 1), None)}


@given(st.sets(st.sampled_from("abce")), st.lists(st.sampled_from([SHORT, LONG]), max_size=4), st.booleans())
def test_whatever_is_accepted_taking_rules_back_leaves_it_as_before(names, rules, early):
    """Under each rule each point is as in the first column of POINTS, or as in the second."""
    q = PointQueue(WorkConfig())
    views = {USUAL: 0, SHORT: 1, LONG: 1}

    def see(rule):
        points = [points[views[rule]] for points in POINTS.values()]
        q.update(shown(*(each for each in points if each is not None), rule=rule))

    see(USUAL)
    for name in names:
        q.accept(name, POINTS[name][0].revision, "ada")
    begun = {t.point.point_id: t for t in q.tickets()}
    stack = [USUAL]
    for rule in rules:
        if rule != stack[-1]:
            stack.append(rule)
            see(rule)
    while len(stack) > 1:
        rule = stack.pop()
        if early:
            see(stack[-1])
        assert q.undo_rule(rule) is None
        see(stack[-1])
    assert {t.point.point_id: t for t in q.tickets()} == begun
