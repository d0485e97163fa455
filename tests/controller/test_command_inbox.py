"""What rests on a record is said when the record is durable, in order, or with the reason why it is not."""

from controller.command_inbox import CommitBarrier
from controller.ledger.journal import LedgerState


def test_nothing_is_said_before_its_record_is_durable():
    said, waiting = [], CommitBarrier()
    for number in (1, 2, 3):
        waiting.hold(number, 0.0, lambda why, number=number: said.append((number, why)))
    waiting.settle(LedgerState(0), 0.1)
    assert said == []
    waiting.settle(LedgerState(2), 0.2)
    assert said == [(1, ""), (2, "")]
    waiting.settle(LedgerState(3), 0.3)
    assert said[-1] == (3, "") and len(said) == 3


def test_what_rests_on_nothing_new_is_said_at_once():
    said, waiting = [], CommitBarrier()
    waiting.hold(0, 0.0, said.append)
    waiting.settle(LedgerState(0), 0.0)
    assert said == [""]


def test_a_failure_and_a_silence_are_told():
    said, waiting = [], CommitBarrier()
    waiting.hold(1, 0.0, said.append)
    waiting.settle(LedgerState(0, "disk full"), 0.0)
    assert said == ["disk full"]
    waiting.hold(2, 10.0, said.append)
    waiting.settle(LedgerState(0), 10.5)
    assert len(said) == 1
    waiting.settle(LedgerState(0), 10.7)
    assert "not written it within 0.6 s" in said[1]
