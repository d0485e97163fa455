"""Numbers and durability of records; the event log."""

from controller.ledger.journal import EventLogger, Journal, LedgerState
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.reasons import said
from tests.support.fake_wire import as_received

BODY = m.Header()


def test_records_are_numbered_in_order_and_taken_once():
    journal = Journal()
    numbers = [journal.add("event", "x", BODY) for _ in range(3)]
    assert [record.number for record in journal.drain()] == numbers == [1, 2, 3]
    assert journal.drain() == () and journal.add("event", "x", BODY) == 4


def test_a_record_is_held_when_the_ledger_says_so():
    journal = Journal()
    number = journal.add("event", "x", BODY)
    assert not journal.holds(number)
    journal.observe(LedgerState(number), 0.0)
    assert journal.holds(number) and not journal.holds(number + 1)


def test_a_ledger_that_takes_nothing_is_trouble_after_its_time_and_no_sooner():
    journal = Journal()
    assert journal.trouble(100.0, 0.6) is None
    journal.add("event", "x", BODY)
    journal.observe(LedgerState(0), 10.0)
    assert journal.trouble(10.5, 0.6) is None
    for now in (10.2, 10.4, 10.6):
        journal.observe(LedgerState(0), now)
    assert journal.trouble(10.75, 0.6) == reasons.ledger_silent(0.75)
    journal.observe(LedgerState(1), 10.8)
    assert journal.trouble(20.0, 0.6) is None


def test_a_slow_ledger_that_goes_on_is_no_trouble():
    journal, now, durable = Journal(), 0.0, 0
    for _ in range(50):
        journal.add("event", "x", BODY)
        journal.add("event", "x", BODY)
        durable += 1
        now += 0.3
        journal.observe(LedgerState(durable), now)
        assert journal.trouble(now, 0.6) is None


def test_a_failure_is_trouble_at_once_until_it_is_over():
    journal = Journal()
    journal.observe(LedgerState(0, reasons.ledger_failed("disk full")), 0.0)
    assert journal.trouble(0.0, 0.6) == reasons.ledger_failed("disk full")
    journal.observe(LedgerState(0), 1.0)
    assert journal.trouble(1.0, 0.6) is None


def test_a_stop_that_is_sent_several_times_is_one_record():
    journal = Journal()
    stops = [
        m.StopRequest(stop_id=name, source="server", user="eve", reason=said("r")) for name in ("a", "a", "b", "a")
    ]
    for stop in stops:
        journal.stops((stop,))
    assert [(record.kind, record.name, record.body.stop_id) for record in journal.drain()] == [
        ("stop", "eve", "a"),
        ("stop", "eve", "b"),
    ]


def test_what_is_said_is_told_once_and_recorded():
    journal = Journal()
    lines = EventLogger(journal)
    lines.now = 3.0
    lines.log(reasons.said("x" * 600))
    (told,) = lines.drain()
    assert (told.header.stamp, told.process, told.reason) == (3.0, "controller", reasons.said("x" * 500))
    assert lines.drain() == ()
    assert [record.body for record in journal.drain()] == [told]


def test_a_line_before_the_first_step_is_one_that_the_wire_carries():
    journal = Journal()
    lines = EventLogger(journal)
    lines.log(reasons.controller_started())
    (event,) = lines.drain()
    assert as_received(event) == event
    assert event.reason == reasons.controller_started()
    (record,) = journal.drain()
    assert (record.kind, record.name, record.body) == ("event", "controller", event)
