"""The record of a robot is checked and written out from the command line."""

import csv
import io
import json
import sqlite3
from pathlib import Path

import pytest

from controller.ledger.audit import main
from controller.ledger.check import verify
from controller.ledger.store import FILE, ORIGIN, SCHEMA_VERSION, Entry, Ledger
from rolling_panda.runtime.state_folder import usual_state_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("2026-02-03T04:05:06Z", "request", "Ada, jr.", '{"ok":false,"reason":"IDLE"}')])
        ledger.append([Entry("2026-02-03T04:05:07Z", "event", "bridge", '{"text":"schneidet «p1»"}')])
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(words)
    told = capsys.readouterr()
    return code, told.out, told.err


def test_a_whole_ledger_is_said_to_be_whole_and_its_hash_can_be_asked_for_again(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = run(capsys, "verify", "--state", str(folder))
    assert code == 0 and "2 rows are as written; newest hash " in out and "--expect HASH" in out
    head = out.split("newest hash ")[1].split()[0]
    assert run(capsys, "verify", "--state", str(folder), "--expect", head)[0] == 0
    code, out, err = run(capsys, "verify", "--state", str(folder), "--expect", "0" * 63 + "1")
    assert code == 1 and "NOT as it was written: no row has the hash" in err
    assert verify(folder, ORIGIN).problem == "", "that of the beginning is in every ledger"


def test_one_row_is_one_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "event", "bridge", "{}")])
    assert "1 row is as written" in run(capsys, "verify", "--state", str(tmp_path))[1]


@pytest.mark.parametrize("text", ["zz", "00", ""])
def test_what_is_no_hash_is_refused_in_words(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(("verify", "--expect", text))
    assert ended.value.code == 2 and "give 64 hexadecimal digits" in capsys.readouterr().err


def test_a_changed_ledger_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / FILE
    path.write_bytes(path.read_bytes().replace(b"IDLE", b"AUTO"))
    code, out, err = run(capsys, "verify", "--state", str(folder))
    assert (code, out) == (1, "") and "row 1 is not as it was written. 0 rows are whole before" in err
    assert verify(folder).head == ORIGIN


@pytest.mark.parametrize("command", ["verify", "export"])
def test_a_ledger_of_a_newer_version_is_not_called_changed(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    database = sqlite3.connect(folder / FILE, isolation_level=None)
    database.execute("ALTER TABLE audit ADD COLUMN signed_by TEXT")
    database.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    database.close()
    code, out, err = run(capsys, command, "--state", str(folder))
    assert (code, out) == (1, "")
    assert (
        "newer version" in err
        and str(folder / FILE) in err
        and "Use that version" in err
        and "NOT as it was written" not in err
    )


def test_json_has_every_row_with_its_body(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "export", "--state", str(folder))
    rows = json.loads(out)
    assert code == 0 and [row["number"] for row in rows] == [1, 2]
    assert rows[0]["name"] == "Ada, jr." and rows[0]["body"] == {"ok": False, "reason": "IDLE"}
    assert rows[1]["body"]["text"] == "schneidet «p1»" and len(rows[1]["hash"]) == 64


def test_a_body_that_is_no_json_is_told_as_it_is_and_text_as_it_was_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Ledger(folder) as ledger:
        ledger.append([Entry("t", "event", "bridge", "{no json")])
    _, out, _ = run(capsys, "export", "--state", str(folder))
    assert json.loads(out)[2]["body"] == "{no json" and "«p1»" in out
    assert run(capsys, "export", "--json", "--state", str(folder))[1] == out


def test_the_folder_is_that_of_the_robots_state(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    state = usual_state_folder("rp7")
    state.mkdir(parents=True)
    Ledger(state).close()
    assert run(capsys, "verify", "--robot-id", "rp7")[0] == 0
    assert run(capsys, "verify", "--robot-id", "rp8")[0] == 1


def test_who_has_read_enough_of_an_export_ends_it_without_a_word(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    told = io.StringIO()
    monkeypatch.setattr("sys.stdout", Closed())
    monkeypatch.setattr("sys.stderr", told)
    assert main(["export", "--state", str(folder)]) == 0
    # Python itself would complain there at its end.
    assert told.closed


def test_csv_has_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "export", "--csv", "--state", str(folder))
    rows = list(csv.DictReader(out.splitlines()))
    assert [(row["number"], row["kind"], row["name"]) for row in rows] == [
        ("1", "request", "Ada, jr."),
        ("2", "event", "bridge"),
    ]
    assert json.loads(rows[0]["body"])["reason"] == "IDLE"


def test_an_empty_ledger_is_an_empty_list(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Ledger(tmp_path).close()
    assert json.loads(run(capsys, "export", "--state", str(tmp_path))[1]) == []
    assert run(capsys, "verify", "--state", str(tmp_path))[0] == 0


def test_what_is_asked_wrongly_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "verify", "--state", str(tmp_path / "no"))
    assert code == 1 and "there is no ledger" in err and len(err.splitlines()) == 1
    (tmp_path / FILE).write_bytes(b"no database" * 50)
    assert run(capsys, "export", "--state", str(tmp_path))[0] == 1
    with pytest.raises(SystemExit):
        main(["verify", "--expect", "12"])
    assert "64 hexadecimal digits" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([])
    assert "COMMAND" in capsys.readouterr().err
