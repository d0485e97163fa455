"""What the controller restores and records when it starts."""

import hashlib
import json
import sqlite3

import msgspec
import pytest

from controller.config import WorkConfig
from controller.ledger.check import verify
from controller.ledger.journal import ApproachRow, Journal, OrderRow, PreviewRequiredRow, TicketRow
from controller.ledger.start import Restored, restored, start_record
from controller.ledger.store import FILE, Entry, Ledger
from controller.work.point_queue import PointQueue
from rolling_panda import reasons
from rolling_panda.errors import LedgerError
from tests.support.fake_wire import pruning_point


def test_a_start_is_recorded_with_its_configuration(tmp_path):
    config = tmp_path / "sim.toml"
    config.write_bytes(b"[controller]\nname = '\xff'\n")
    record = start_record(config, "run-7")
    body = json.loads(msgspec.json.encode(record.body))
    assert (record.number, record.kind, record.name) == (0, "start", "controller")
    assert body["run_id"] == "run-7" and body["config"] == "[controller]\nname = '\ufffd'\n"
    assert body["config_sha256"] == hashlib.sha256(config.read_bytes()).hexdigest()
    assert body["program"]["version"]


def test_the_newest_of_each_row_is_restored_and_nothing_of_an_empty_ledger(tmp_path):
    assert restored(tmp_path) == Restored()
    old, new = (TicketRow(point=pruning_point("p1"), state=state) for state in ("PROPOSED", "ACCEPTED"))
    other = TicketRow(point=pruning_point("p2"), state="REJECTED", reason=reasons.said("too thick"))
    orders = [OrderRow(order=(name,), revision=number, user="ada") for number, name in enumerate(("p2", "p1"))]
    rows = [
        *(("ticket", row.point.point_id, row) for row in (old, other, new)),
        *(("order", "order", row) for row in orders),
        *(("preview", "preview", PreviewRequiredRow(required=required)) for required in (True, False)),
        *(
            ("approach", name, ApproachRow(azimuth=azimuth))
            for name, azimuth in (("p1", 0.1), ("p2", 0.2), ("p1", 0.3))
        ),
    ]
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", kind, name, msgspec.json.encode(row).decode()) for kind, name, row in rows])
    found = restored(tmp_path)
    assert found.tickets == (other, new)
    assert (found.order, found.preview) == (orders[-1], PreviewRequiredRow(required=False))
    assert found.approaches == (("p2", ApproachRow(azimuth=0.2)), ("p1", ApproachRow(azimuth=0.3)))


def test_a_cut_under_way_in_a_ledger_of_schema_1_is_restored(tmp_path):
    row = TicketRow(point=pruning_point("p1"), state="CUTTING", cut_id="run-1", user="ada")
    body = msgspec.json.encode(row).decode().replace('"state":"CUTTING"', '"state":"INTENT"')
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "ticket", "p1", body)])
    database = sqlite3.connect(tmp_path / FILE, isolation_level=None)
    database.execute("PRAGMA user_version = 1")
    database.close()
    assert restored(tmp_path).tickets == (row,)
    queue = PointQueue(WorkConfig(), Journal())
    queue.restore(restored(tmp_path).tickets)
    assert queue.entries()[0].state == "UNKNOWN", "somebody has to look how it ended"
    assert verify(tmp_path).problem == "", "the row itself is as it was written"


def test_the_reason_of_a_point_in_a_ledger_of_schema_2_is_restored_from_its_text(tmp_path):
    row = TicketRow(point=pruning_point("p1"), state="REJECTED", reason=reasons.said("x" * 500), user="ada")
    body = json.loads(msgspec.json.encode(row)) | {"reason": "x" * 600}
    without = json.loads(msgspec.json.encode(msgspec.structs.replace(row, reason=None))) | {"reason": ""}
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "ticket", "p1", json.dumps(body)), Entry("t", "ticket", "p2", json.dumps(without))])
    assert restored(tmp_path).tickets == (row, msgspec.structs.replace(row, reason=None))


def test_a_point_that_an_earlier_version_explained_in_words_is_restored(tmp_path):
    point = msgspec.structs.replace(pruning_point("p1"), reason=reasons.said("lowest cane"))
    row = TicketRow(point=point, state="ACCEPTED", accepted=point, user="ada")
    body = msgspec.json.decode(msgspec.json.encode(row))
    body["point"]["reason"] = body["accepted"]["reason"] = "lowest cane"
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "ticket", "p1", json.dumps(body))])
    assert restored(tmp_path).tickets == (row,)


def started(name, version):
    return Entry("t", "start", name, json.dumps({"program": {"version": version}}))


@pytest.mark.parametrize(
    ("starts", "told"),
    [
        ((started("first", "0.1"), started("second", "0.2"), started("third", "0.3")), "last written by version 0.3:"),
        ((), "a version that did not say which:"),
        ((Entry("t", "start", "controller", "{}"),), "a version that did not say which:"),
    ],
)
def test_a_row_that_this_version_does_not_understand_is_named_with_the_version_that_wrote_it(tmp_path, starts, told):
    with Ledger(tmp_path) as ledger:
        ledger.append([*starts, Entry("t", "ticket", "p9", '{"state": "ELSEWHERE"}')])
    with pytest.raises(LedgerError) as caught:
        restored(tmp_path)
    assert "ticket p9" in str(caught.value) and told in str(caught.value)
