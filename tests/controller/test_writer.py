"""Records become durable off the control loop; what cannot be written is told, kept and written later."""

import json
import threading
import time

import pytest

from controller.ledger import writer as writer_module
from controller.ledger.check import reading, verify
from controller.ledger.journal import LedgerState, Record, TicketRow
from controller.ledger.store import Ledger, read
from controller.ledger.writer import LedgerWriter
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.errors import LedgerError
from tests.support.fake_wire import pruning_point
from tests.support.waiting import until


def record(number, text="x"):
    return Record(number, "event", "test", m.Header(frame_id=text))


def line(text, process="server"):
    return m.LogEvent(header=m.Header(), process=process, reason=reasons.said(text))


@pytest.fixture
def writers():
    made = []

    def make(*args, **changes):
        made.append(LedgerWriter(*args, **changes))
        return made[-1]

    yield make
    for writer in made:
        writer.close()


class Disk:
    """A ledger whose disk can be full or slow."""

    def __init__(self):
        self.rows, self.full, self.go, self.closed, self.tries = [], False, threading.Event(), False, 0
        self.go.set()

    def append(self, entries):
        new = list(entries)
        self.tries += 1
        self.go.wait(10.0)
        if self.full:
            raise LedgerError("cannot write: database or disk is full")
        self.rows += new

    def close(self):
        self.closed = True


def test_what_is_handed_over_is_in_the_ledger_when_the_state_says_so(tmp_path, writers):
    writer = writers(lambda: Ledger(tmp_path))
    writer.write([record(1, "a"), record(2, "b")])
    until(lambda: writer.state.durable == 2)
    with reading(tmp_path) as database:
        rows = list(read(database))
    assert [json.loads(row.entry.body)["frame_id"] for row in rows] == ["a", "b"]
    assert rows[0].entry.at.endswith("+00:00") and verify(tmp_path).problem == ""


def test_handing_over_never_waits_for_a_slow_disk(writers):
    disk = Disk()
    writer = writers(lambda: disk)
    disk.go.clear()
    began = time.monotonic()
    for number in range(1, 1001):
        writer.write([record(number)])
    assert time.monotonic() - began < 0.5 and writer.state.durable == 0
    disk.go.set()
    until(lambda: writer.state.durable == 1000)
    assert len(disk.rows) == 1000


def test_a_full_disk_is_told_and_nothing_is_lost_when_there_is_room_again(writers):
    disk = Disk()
    disk.full = True
    writer = writers(lambda: disk)
    writer.write([record(1)])
    until(lambda: writer.state.failure)
    assert writer.state == LedgerState(0, reasons.ledger_failed("cannot write: database or disk is full"))
    writer.write([record(2)])
    disk.full = False
    until(lambda: writer.state.durable == 2)
    assert writer.state.failure is None and len(disk.rows) == 2


def test_a_ledger_that_cannot_be_opened_is_told_and_tried_again(tmp_path, writers):
    folder = tmp_path / "later"
    writer = writers(lambda: Ledger(folder))
    writer.write([record(1)])
    until(lambda: writer.state.failure)
    folder.mkdir()
    until(lambda: writer.state.durable == 1)


def test_a_disk_that_hangs_keeps_no_process_from_ending(writers):
    writers(lambda: Disk())
    assert [thread.daemon for thread in threading.enumerate() if thread.name == "ledger"] == [True]


def test_the_end_writes_what_waits_and_closes(writers):
    disk = Disk()
    writer = writers(lambda: disk)
    writer.write([record(number) for number in range(1, 3001)])
    writer.close()
    assert len(disk.rows) == 3000 and disk.closed


def test_the_report_tells_of_what_is_durable_and_of_no_more(writers):
    disk = Disk()
    writer = writers(lambda: disk)
    cutting, cut = (TicketRow(point=pruning_point("p1"), state=state, cut_id="c1") for state in ("CUTTING", "DONE"))
    writer.write([Record(1, "ticket", "p1", cutting)])
    until(lambda: writer.report.cuts)
    assert [each.outcome for each in writer.report.cuts] == [""]
    disk.go.clear()
    writer.write([Record(2, "ticket", "p1", cut)])
    time.sleep(0.05)
    assert [each.outcome for each in writer.report.cuts] == [""]
    disk.go.set()
    until(lambda: [each.outcome for each in writer.report.cuts] == ["DONE"])


def test_a_flood_of_lines_is_counted_instead_of_recorded(writers):
    disk, now = Disk(), [0.0]
    writer = writers(lambda: disk, clock=lambda: now[0])
    for number in range(1000):
        writer.note(line(f"refused {number}"))
    now[0] += 1.0
    writer.note(line("after"))
    until(lambda: len(disk.rows) == 202)
    assert "refused 199" in disk.rows[199].body
    assert (disk.rows[200].kind, disk.rows[200].name) == ("event", "controller")
    left_out = json.loads(disk.rows[200].body)
    assert writer.state.durable == 0
    assert left_out["process"] == "controller"
    assert left_out["header"] == json.loads(disk.rows[201].body)["header"]
    assert (
        left_out["reason"] == {"code": "lines_unrecorded", "values": [["lines", 800]]}
        and "after" in disk.rows[201].body
    )


def test_a_line_of_another_process_is_recorded_under_its_name_and_makes_no_record_durable(writers):
    disk = Disk()
    writer = writers(lambda: disk)
    writer.note(line("refused"))
    until(lambda: disk.rows)
    assert [(row.kind, row.name) for row in disk.rows] == [("event", "server")]
    assert writer.state.durable == 0


def test_the_disk_waits_for_the_control_loop(writers, monkeypatch):
    given = []
    monkeypatch.setattr(
        writer_module, "set_priority", lambda priority: given.append((priority, threading.current_thread().name))
    )
    disk = Disk()
    writers(lambda: disk).write([record(1)])
    until(lambda: disk.rows)
    assert given == [("interface", "ledger")]


def test_at_the_end_a_full_disk_is_given_up_and_the_ledger_closed(writers):
    disk, before = Disk(), threading.active_count()
    disk.full = True
    writer = writers(lambda: disk)
    writer.write([record(1)])
    until(lambda: writer.state.failure)
    writer.close()
    assert disk.closed and threading.active_count() == before


def test_each_flood_is_counted_for_itself(writers):
    disk, now = Disk(), [0.0]
    writer = writers(lambda: disk, clock=lambda: now[0])
    for _ in range(2):
        disk.rows.clear()
        for number in range(1000):
            writer.note(line(f"refused {number}"))
        now[0] += 100.0
        writer.note(line("after"))
        until(lambda: any("after" in row.body for row in disk.rows))
        assert [json.loads(row.body)["reason"]["values"] for row in disk.rows if row.name == "controller"] == [
            [["lines", 800]]
        ]
        now[0] += 100.0


def test_a_writer_with_nothing_to_do_ends_at_once(writers):
    before = threading.active_count()
    writers(lambda: Disk()).close()
    assert threading.active_count() == before


def test_a_full_disk_is_tried_again_now_and_then(writers):
    disk = Disk()
    disk.full = True
    writer = writers(lambda: disk)
    writer.write([record(1)])
    until(lambda: writer.state.failure)
    time.sleep(0.2)
    assert disk.tries < 20


def test_a_disk_that_hangs_is_given_up_at_the_end(writers):
    disk = Disk()
    disk.go.clear()
    writer = writers(lambda: disk)
    writer.write([record(1)])
    began = time.monotonic()
    writer.close()
    assert time.monotonic() - began < 8.0
    disk.go.set()
