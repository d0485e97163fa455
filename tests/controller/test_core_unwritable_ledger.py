"""Without a ledger nothing is cut, whatever moves comes to rest, and a stop works as ever."""

import numpy as np

from controller.ledger.journal import LedgerState, Records
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import entry, finish, run_until, working
from tests.support.points import point
from tests.support.sent import every

SHOWN = (point("a", (0.6, 0.75, 1.0)), point("b", (0.9, 0.75, 1.0)))


def driving():
    r = working(SHOWN)
    run_until(r, lambda s: s is not None and s.mode == "AUTO" and np.any(np.abs(r.xi[:2]) > 0.3), 20.0)
    return r


def at_rest(r, within_s):
    began = r.now
    while np.any(np.abs(r.record[-1]) > 1e-3):
        r.step()
        assert r.now - began < within_s


def test_a_failure_is_a_fault_and_the_robot_rests_within_a_second():
    r = driving()
    r.ledger = LedgerState(r.ledger.durable, reasons.ledger_failed("the disk is full"))
    r.step()
    run_until(r, lambda s: s.mode == "FAULT", r.now + 0.1)
    at_rest(r, 1.0)
    assert r.state.reason == r.ledger.failure and r.cuts == []
    assert r.ask(intents.Acknowledge(user="ada", role="supervisor")).reason.code == "cause_remains"
    r.stop()
    run_until(r, lambda s: s.mode == "ESTOP_LATCHED", r.now + 0.2)


def test_a_ledger_that_hangs_is_a_fault_within_a_second():
    r = driving()
    held = r.ledger
    began = r.now
    while r.state.mode == "AUTO" or np.any(np.abs(r.record[-1]) > 1e-3):
        # Something happens that wants recording; nothing of it becomes durable.
        r.ask(intents.RejectPoint(user="ada", point_id="b"))
        r.step()
        r.ledger = held
        assert r.now - began < 1.0
    assert r.state.mode == "FAULT" and "written nothing" in text_of(r.state.reason)


def test_the_blades_wait_for_the_record_of_their_intent():
    r, frozen, waited = working(SHOWN), None, 0
    while waited < 40:
        for record in (record for records in every(r.step(), Records) for record in records.rows):
            if record.kind == "ticket" and record.body.state == "CUTTING":
                frozen = LedgerState(record.number - 1)
        if frozen is not None:
            r.ledger, waited = frozen, waited + 1
        assert r.now < 30.0
    assert r.cuts == [] and r.state.mode == "AUTO"
    r.ledger = LedgerState(r.controller.recorded)
    r.run(0.1)
    assert len(r.cuts) == 1


def test_work_goes_on_when_the_cause_has_gone_and_somebody_says_so():
    r = driving()
    durable = r.ledger.durable
    r.ledger = LedgerState(durable, reasons.ledger_failed("disk full"))
    run_until(r, lambda s: s.mode == "FAULT", r.now + 0.1)
    r.run(0.5)
    r.ledger = LedgerState(r.controller.recorded)
    r.run(1.2)
    assert r.ask(intents.Acknowledge(user="ada", role="supervisor")).ok
    for intent in (intents.Arm(user="ada"), intents.Start(user="ada")):
        assert r.ask(intent).ok, r.state
    finish(r, r.now + 60.0)
    assert [entry(r, name).state for name in ("a", "b")] == ["DONE", "DONE"]
