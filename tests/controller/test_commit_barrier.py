"""What rests on a record is said when the record is durable, in order, or with the reason why it is not."""

from controller.ledger.journal import LedgerState
from controller.loop import CommitBarrier
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.transport.inbox import Reply, Request


def reply(ok=True):
    return Reply(
        Request("please", 0.0, lambda: True, lambda answer: None),
        m.Answer(ok=ok, reason=None if ok else reasons.said("no")),
    )


def test_nothing_is_said_before_its_record_is_durable():
    waiting = CommitBarrier()
    for number in (1, 2, 3):
        waiting.hold(number, 0.0, number)
    assert waiting.settle(LedgerState(0), 0.1) == []
    assert waiting.settle(LedgerState(2), 0.2) == [1, 2]
    assert waiting.settle(LedgerState(3), 0.3) == [3]


def test_what_rests_on_nothing_new_is_said_at_once():
    waiting = CommitBarrier()
    waiting.hold(0, 0.0, "now")
    assert waiting.settle(LedgerState(0), 0.0) == ["now"]


def test_a_failure_and_a_silence_turn_a_consent_into_a_refusal():
    waiting = CommitBarrier()
    waiting.hold(1, 0.0, reply())
    waiting.hold(1, 0.0, refused := reply(ok=False))
    waiting.hold(1, 0.0, "state")
    failed, *others = waiting.settle(LedgerState(0, reasons.ledger_failed("disk full")), 0.0)
    assert failed.answer.reason == reasons.decision_unrecorded(reasons.ledger_failed("disk full"))
    assert not failed.answer.ok
    assert others == [refused, "state"]
    waiting.hold(2, 10.0, reply())
    assert waiting.settle(LedgerState(0), 10.5) == []
    (late,) = waiting.settle(LedgerState(0), 10.75)
    assert late.answer.reason == reasons.decision_unrecorded(reasons.ledger_silent(0.75))
