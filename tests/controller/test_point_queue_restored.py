"""The queue after a restart: decisions stand, nothing resumes by itself, an unfinished cut is UNKNOWN."""

import msgspec

from controller.config import WorkConfig
from controller.ledger.journal import Journal, LedgerState, TicketRow
from controller.work.point_queue import PointQueue
from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.controller.test_point_queue import POINT, point, shown


class Life:
    """A queue and its journal; `restarted` is what comes of it after a restart, by way of the written rows."""

    def __init__(self, rows=()):
        self.journal = Journal()
        self.queue = PointQueue(WorkConfig(), self.journal)
        self.before = dict(rows)
        self.queue.restore(msgspec.json.decode(body, type=TicketRow) for body in self.before.values())

    def rows(self):
        newest = dict(self.before)
        for record in self.journal.drain():
            if record.kind == "ticket":
                newest.pop(record.name, None)
                newest[record.name] = msgspec.json.encode(record.body)
        self.before = newest
        return newest

    def restarted(self):
        return Life(self.rows())

    def state(self, point_id="a"):
        ticket = self.queue.get(point_id)
        return None if ticket is None else ticket.state


def begun(*points):
    life = Life()
    life.queue.update(shown(*points))
    return life


def test_an_acceptance_stands_but_is_not_worked_on_before_the_point_is_seen_again():
    life = begun(point(), point("b", position=(2.0, 0.85, 1.0)))
    assert life.queue.accept("a", 3, "ada") is None
    life = life.restarted()
    assert life.state() == "ACCEPTED" and life.queue.next() is None and life.queue.accepted() == ()
    assert life.queue.entries()[0].reason == reasons.accepted_before_restart()
    life.queue.update(shown())
    assert life.state() == "ACCEPTED"
    life.queue.update(shown(point(revision=4, position=(1.0, 0.852, 1.0))))
    assert life.queue.next().accepted == POINT and life.queue.next().user == "ada"
    assert life.queue.entries()[0].reason is None


def test_an_acceptance_is_void_when_the_point_is_elsewhere_after_the_restart():
    life = begun(point())
    life.queue.accept("a", 3, "ada")
    life = life.restarted()
    (voided,) = life.queue.update(shown(point(position=(1.0, 0.85, 1.01))))
    assert "10 mm from where it was accepted" in text_of(voided) and life.state() == "PROPOSED"


def test_an_acceptance_that_does_not_fit_its_hash_is_none():
    life = begun(point())
    life.queue.accept("a", 3, "ada")
    (body,) = life.rows().values()
    life = Life({"a": body.replace(b"0.85", b"0.86")})
    assert life.state() == "REJECTED" and life.queue.get("a").reason == reasons.record_damaged()


def test_what_a_person_is_asked_about_is_told_with_its_point_until_perception_shows_it():
    life = begun(point(), point("b", position=(2.0, 0.85, 1.0)))
    life.queue.accept("a", 3, "ada")
    life.queue.reject("b", "ada", "no")
    life = life.restarted()
    entries = {entry.point_id: entry for entry in life.queue.entries()}
    assert entries["a"].recorded == POINT and entries["b"].recorded is None
    life.queue.update(shown(point()))
    assert all(entry.recorded is None for entry in life.queue.entries())


def test_what_is_done_or_rejected_stays_so():
    life = begun(point(), point("b", position=(2.0, 0.85, 1.0)))
    life.queue.accept("a", 3, "ada")
    life.queue.begin_cut("a", "run-1")
    life.queue.resolve("a", "DONE", reasons.said("cut"))
    life.queue.reject("b", "ada", "a wire behind it")
    for _ in range(3):
        life = life.restarted()
        assert (life.state("a"), life.state("b")) == ("DONE", "REJECTED")
    entry = next(entry for entry in life.queue.entries() if entry.point_id == "b")
    assert (entry.user, entry.reason) == ("ada", reasons.said("a wire behind it"))
    assert life.queue.get("a").cut_id == "run-1"


def test_an_intent_without_a_result_is_unknown_and_stays_so():
    life = begun(point())
    life.queue.accept("a", 3, "ada")
    life.queue.begin_cut("a", "run-1")
    life = life.restarted()
    assert life.state() == "UNKNOWN" and life.queue.next() is None
    life.queue.update(shown(point()))
    assert life.state() == "UNKNOWN"
    assert "UNKNOWN" in str(life.rows()["a"]) and life.restarted().state() == "UNKNOWN"


def test_proposals_are_left_to_perception():
    life = begun(point())
    assert life.restarted().state() is None
    life.queue.update(shown())
    assert "WITHDRAWN" in str(life.rows()["a"])


def test_a_name_that_perception_gives_to_another_cane_after_its_restart_keeps_both_apart():
    life = begun(point())
    life.queue.accept("a", 3, "ada")
    life.queue.begin_cut("a", "run-1")
    life = life.restarted()
    life.queue.update(shown(point(position=(3.0, 0.85, 1.0))))
    states = {entry.point_id: entry.state for entry in life.queue.entries()}
    assert states.pop("a") == "PROPOSED"
    ((name, state),) = states.items()
    assert name.startswith("a:") and state == "UNKNOWN"
    again = life.restarted()
    assert again.state(name) == "UNKNOWN" and again.state("a") is None


def test_an_intent_is_held_only_when_its_own_record_is_durable():
    life = begun(point())
    life.queue.accept("a", 3, "ada")
    number = life.queue.begin_cut("a", "run-1")
    life.journal.observe(LedgerState(number - 1), 0.0)
    assert not life.queue.recorded(number)
    life.journal.observe(LedgerState(number), 0.0)
    assert life.queue.recorded(number)


def test_only_what_matters_is_recorded():
    life = begun(point())
    life.rows()
    for step in range(50):
        life.queue.update(shown(point(confidence=0.5 + step / 200)))
    assert life.journal.drain() == ()
