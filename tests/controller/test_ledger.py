"""What the ledger has acknowledged is there for good, in a chain that shows every change."""

import hashlib
import os
import random
import resource
import signal
import sqlite3
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from controller.ledger import check, store
from controller.ledger.check import reading, verify
from controller.ledger.start import restored
from controller.ledger.store import FILE, HEAD, ORIGIN, SCHEMA_VERSION, Entry, Ledger, Row, chained, read
from rolling_panda.errors import LedgerError
from rolling_panda.runtime.launch import child_environment


def entry(number: int, kind: str = "event", name: str = "bridge") -> Entry:
    return Entry(f"2026-02-03T04:05:{number % 60:02}.000000+00:00", kind, name, f'{{"text":"row {number} ü"}}')


def written(folder: Path, count: int = 12) -> Path:
    with Ledger(folder) as ledger:
        for number in range(1, count + 1):
            assert ledger.append([entry(number)]) == number
    return folder / FILE


def newer(folder: Path) -> None:
    """The ledger as a version to come might leave it: with one more column, and the number of its tables' form."""
    with Ledger(folder) as ledger:
        ledger.append([Entry("t", "start", "controller", '{"program": {"version": "7.1.0"}, "robots": 2}')])
    database = sqlite3.connect(folder / FILE, isolation_level=None)
    database.execute("ALTER TABLE audit ADD COLUMN signed_by TEXT")
    database.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    database.close()


def problem_of(folder: Path) -> str:
    try:
        return verify(folder).problem
    except LedgerError as error:
        return str(error)


def rows(folder: Path) -> list[object]:
    with reading(folder) as database:
        return list(read(database))


def test_rows_are_there_after_reopening_and_numbers_go_on(tmp_path: Path) -> None:
    written(tmp_path)
    with Ledger(tmp_path) as ledger:
        assert ledger.append([entry(13), entry(14)]) == 14
    verdict = verify(tmp_path)
    assert (verdict.rows, verdict.problem) == (14, "")
    assert verify(tmp_path, verdict.head).problem == ""
    assert "no row has the hash" in verify(tmp_path, bytes(31) + b"\1").problem


def test_the_newest_row_of_each_name_is_told(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "ticket", name, body) for name, body in (("b", "1"), ("a", "2"), ("b", "3"))])
        ledger.append([Entry("t", "event", "c", "4")])
        assert list(ledger.newest("ticket")) == [("a", "2"), ("b", "3")]


def test_it_can_be_read_and_checked_while_it_is_written(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([entry(1)])
        with reading(tmp_path) as database:
            before = list(read(database))
            ledger.append([entry(2)])
        assert len(before) == 1 and verify(tmp_path).rows == 2


def test_a_row_added_during_a_check_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path)
    with Ledger(tmp_path) as ledger:

        def read_slowly(database: sqlite3.Connection) -> Iterator[Row]:
            yield from read(database)
            ledger.append([entry(99)])

        monkeypatch.setattr(check, "read", read_slowly)
        verdict = check.verify(tmp_path)
    assert (verdict.problem, verdict.rows) == ("", 12)


def test_every_changed_byte_is_found_or_changes_nothing(tmp_path: Path) -> None:
    path = written(tmp_path)
    whole, original = path.read_bytes(), rows(tmp_path)
    at = whole.index("row 7 ü".encode())
    # The whole of one row with its hash, and places everywhere else.
    places = sorted({*range(at - 60, at + 60), *range(0, len(whole), 41), *range(0, 200)})
    found = 0
    for place in places:
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        problem = problem_of(tmp_path)
        found += bool(problem)
        assert problem or rows(tmp_path) == original, f"byte {place}"
    assert found > 100
    path.write_bytes(whole)
    assert verify(tmp_path).problem == ""


def test_what_was_changed_by_hand_is_found(tmp_path: Path) -> None:
    path = written(tmp_path)
    whole = path.read_bytes()

    def after(*statements: str) -> str:
        path.write_bytes(whole)
        database = sqlite3.connect(path, isolation_level=None)
        for statement in ("DROP TRIGGER no_update", "DROP TRIGGER no_delete", *statements):
            database.execute(statement)
        triggers = ("CREATE TRIGGER no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, "
                    "'rows are never changed'); END", "CREATE TRIGGER no_delete BEFORE DELETE ON audit BEGIN SELECT "
                    "RAISE(ABORT, 'rows are never deleted'); END")  # fmt: skip
        for trigger in triggers:
            database.execute(trigger)
        database.close()
        return verify(tmp_path).problem

    assert after() == ""
    assert "row 5 is not as it was written" in after("UPDATE audit SET body = '{}' WHERE number = 5")
    assert "after row 4 comes row 6" in after("DELETE FROM audit WHERE number = 5")
    assert "12 rows were written, 11 are there" in after("DELETE FROM audit WHERE number = 12")
    cut = ("DELETE FROM audit WHERE number = 12", "UPDATE sqlite_sequence SET seq = 11")
    assert "row 12, which ledger.head names as the newest, is not in it" in after(*cut)
    with pytest.raises(LedgerError, match="changed from outside.*keep the folder as evidence"):
        Ledger(tmp_path)


@pytest.mark.parametrize("count", [1, 12])
def test_a_ledger_whose_newest_row_was_changed_is_not_gone_on_with(tmp_path: Path, count: int) -> None:
    database = sqlite3.connect(written(tmp_path, count), isolation_level=None)
    database.execute("DROP TRIGGER no_update")
    database.execute(f"UPDATE audit SET body = '{{}}' WHERE number = {count}")
    database.close()
    with pytest.raises(LedgerError, match=f"row {count} is not as it was written"):
        Ledger(tmp_path)


@pytest.mark.parametrize(
    ("head", "problem"),
    [
        (b"\xff\xfe", "cannot be read"),
        (b"0 abcd\n", "is not as it was written"),
        (None, "cannot be read"),
        (b"9" * 30 + b" 00\n", "cannot be read"),
    ],
)
def test_a_head_that_cannot_be_trusted_is_refused_in_words(tmp_path: Path, head: bytes | None, problem: str) -> None:
    written(tmp_path)
    (tmp_path / HEAD).unlink()
    if head is None:
        (tmp_path / HEAD).mkdir()
    else:
        (tmp_path / HEAD).write_bytes(head)
    with pytest.raises(LedgerError, match=f"{HEAD} {problem}"):
        Ledger(tmp_path)


def test_rows_without_a_head_are_not_gone_on_with(tmp_path: Path) -> None:
    written(tmp_path)
    (tmp_path / HEAD).unlink()
    with pytest.raises(LedgerError, match=f"{HEAD} is missing"):
        Ledger(tmp_path)


def test_the_chain_is_that_of_the_text_in_utf_8_so_that_every_version_verifies_it() -> None:
    text = '[7, "t", "event", "é", "{}"]'.encode()
    assert chained(ORIGIN, 7, Entry("t", "event", "é", "{}")) == hashlib.sha256(ORIGIN + text).digest()


def test_a_ledger_of_a_newer_version_is_called_newer_and_left_alone(tmp_path: Path) -> None:
    path = written(tmp_path)
    newer(tmp_path)
    as_it_was = path.read_bytes()
    for attempt in (Ledger, verify):
        with pytest.raises(
            LedgerError, match=f"{path} is of a newer version.*its schema is {SCHEMA_VERSION + 1}.*Use that"
        ) as refused:
            attempt(tmp_path)
        assert "changed" not in str(refused.value)
    assert path.read_bytes() == as_it_was


@pytest.mark.parametrize("version", range(SCHEMA_VERSION))
def test_a_ledger_of_an_older_version_is_whole_and_goes_on(tmp_path: Path, version: int) -> None:
    database = sqlite3.connect(written(tmp_path), isolation_level=None)
    database.execute(f"PRAGMA user_version = {version}")
    assert verify(tmp_path).problem == ""
    with Ledger(tmp_path) as ledger:
        assert ledger.append([entry(13)]) == 13
    assert database.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,), "an older program refuses it"
    database.close()
    assert verify(tmp_path).problem == ""


@pytest.mark.parametrize(("kind", "body"), [("order", '{"of_next_year": true}'), ("ticket", "[1, 2]")])
def test_rows_of_a_newer_version_are_refused_by_naming_the_version(tmp_path: Path, kind: str, body: str) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([Entry("t", "start", "controller", '{"program": {"version": "7.1.0"}, "robots": 2}')])
        ledger.append([Entry("t", kind, "name", body)])
    with pytest.raises(LedgerError, match=rf"tells of {kind}.*last written by version 7\.1\.0: use that version"):
        restored(tmp_path)


def test_the_record_is_for_its_owner_alone_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        written(tmp_path, 1)
    finally:
        os.umask(before)
    assert {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in (FILE, HEAD)} == {0o600}


def test_a_ledger_that_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(LedgerError, match=f"^cannot open the ledger .*none/{FILE}: "):
        Ledger(tmp_path / "none")


def test_a_folder_in_the_ledgers_place_is_named(tmp_path: Path) -> None:
    (tmp_path / FILE).mkdir()
    with pytest.raises(LedgerError, match=f"^cannot open the ledger {tmp_path / FILE}: "):
        Ledger(tmp_path)


def test_a_page_that_is_damaged_is_told_when_the_ledger_is_opened_and_no_file_stays_open(tmp_path: Path) -> None:
    path = written(tmp_path)
    content = bytearray(path.read_bytes())
    content[4096:8192] = bytes(4096)
    path.write_bytes(content)
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(LedgerError, match=f"^cannot read the ledger {path}: "):
        Ledger(tmp_path)
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_new_ledger_has_its_head_and_name_on_the_disk_and_asks_for_each_row_to_be_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    statements: list[str] = []

    def connect(*args: Any, **words: Any) -> sqlite3.Connection:
        database = connected(*args, **words)
        database.set_trace_callback(statements.append)
        return database

    connected = sqlite3.connect
    monkeypatch.setattr(store, "sync_folder", synced.append)
    monkeypatch.setattr(sqlite3, "connect", connect)
    Ledger(tmp_path).close()
    assert synced == [tmp_path] and (tmp_path / HEAD).exists()
    assert "PRAGMA synchronous = FULL" in statements


def test_a_writer_waits_half_a_second_for_a_program_that_holds_the_file(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        other = sqlite3.connect(tmp_path / FILE, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        began = time.monotonic()
        with pytest.raises(LedgerError, match="locked"):
            ledger.append([entry(1)])
        assert time.monotonic() - began < 3.0
        other.close()
        assert ledger.append([entry(1)]) == 1


def test_it_may_be_opened_on_one_thread_and_written_on_another(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger, ThreadPoolExecutor(1) as other:
        assert other.submit(ledger.append, [entry(1)]).result() == 1


def test_of_rows_that_cannot_all_be_written_none_is(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([entry(1)])
        with pytest.raises(LedgerError, match="cannot write"):
            ledger.append([entry(2), Entry("t", "event", None, "{}")])  # type: ignore[arg-type]
        assert ledger.append([entry(2)]) == 2
    assert verify(tmp_path).problem == ""


def test_a_head_that_cannot_be_written_keeps_no_row_out_and_no_file_open(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        assert ledger.append([entry(1)]) == 1
        before = len(os.listdir("/proc/self/fd"))
        for number in range(2, 22):
            assert ledger.append([entry(number)]) == number
        assert len(os.listdir("/proc/self/fd")) == before
        (tmp_path / HEAD).unlink()
        (tmp_path / HEAD).mkdir()
        assert ledger.append([entry(22)]) == 22


def test_an_index_without_one_of_its_rows_is_found(tmp_path: Path) -> None:
    path = written(tmp_path)

    def schema(*statements: tuple[str, tuple[Any, ...]]) -> list[Any]:
        database = sqlite3.connect(path, isolation_level=None)
        database.execute("PRAGMA writable_schema = ON")
        found = database.execute("SELECT * FROM sqlite_schema WHERE name = 'newest'").fetchall()
        for statement, values in statements:
            database.execute(statement, values)
        database.close()
        return found

    (index,) = schema(("DELETE FROM sqlite_schema WHERE name = 'newest'", ()))
    with Ledger(tmp_path) as ledger:
        ledger.append([entry(13)])
    schema(("INSERT INTO sqlite_schema VALUES (?, ?, ?, ?, ?)", index))
    assert verify(tmp_path).problem.startswith("the file is damaged: ")


def test_another_table_in_the_file_is_found(tmp_path: Path) -> None:
    written(tmp_path)
    database = sqlite3.connect(tmp_path / FILE, isolation_level=None)
    database.execute("CREATE TABLE more (x)")
    database.close()
    assert problem_of(tmp_path) == "its tables are not those of a ledger"


def test_what_went_wrong_with_which_ledger_is_told(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    ledger.close()
    with pytest.raises(LedgerError, match=f"cannot write the ledger {tmp_path / FILE}: "):
        ledger.append([entry(1)])
    with pytest.raises(LedgerError, match=f"cannot read the ledger {tmp_path / FILE}: "):
        list(ledger.newest("event"))


def test_rows_refuse_to_be_changed(tmp_path: Path) -> None:
    path = written(tmp_path)
    database = sqlite3.connect(path)
    with pytest.raises(sqlite3.IntegrityError, match="never changed"):
        database.execute("UPDATE audit SET body = ''")
    with pytest.raises(sqlite3.IntegrityError, match="never deleted"):
        database.execute("DELETE FROM audit")
    database.close()


def test_a_lost_end_of_the_write_ahead_log_is_found(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    with Ledger(here) as ledger:
        for number in range(1, 5):
            ledger.append([entry(number)])
        # As a killed process leaves it: the rows are in the log, not in the file.
        for name in (FILE, f"{FILE}-wal", HEAD):
            (there / name).write_bytes((here / name).read_bytes())
    assert verify(there).rows == 4 and verify(there).problem == ""
    log = there / f"{FILE}-wal"
    content = bytearray(log.read_bytes())
    content[content.rindex(b"row 4")] ^= 1
    (there / f"{FILE}-shm").unlink(missing_ok=True)
    log.write_bytes(content)
    assert "row 4, which ledger.head names" in verify(there).problem


def test_a_full_disk_leaves_what_was_there_and_writing_goes_on_when_there_is_room(tmp_path: Path) -> None:
    with Ledger(tmp_path) as ledger:
        ledger.append([entry(1)])
        size = max(path.stat().st_size for path in tmp_path.iterdir())
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 4096, before[1]))
        try:
            with pytest.raises(LedgerError, match="cannot write the ledger"):
                for _ in range(50):
                    ledger.append([Entry("t", "event", "x", "y" * 4000)])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        count = verify(tmp_path).rows
        assert verify(tmp_path).problem == "" and count >= 1
        assert ledger.append([entry(2)]) == count + 1
    assert verify(tmp_path).rows == count + 1 and verify(tmp_path).problem == ""


def test_what_is_no_ledger_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(LedgerError, match="there is no ledger.*--state"):
        verify(tmp_path)
    (tmp_path / FILE).write_bytes(b"something else" * 100)
    with pytest.raises(LedgerError, match=f"cannot open the ledger {tmp_path / FILE}: "):
        Ledger(tmp_path)
    assert "not a database" in verify(tmp_path).problem


WRITER = """
import sys
from pathlib import Path
from controller.ledger.store import Entry, Ledger
with Ledger(Path(sys.argv[1])) as ledger:
    while True:
        print(ledger.append([Entry("t", "event", "x", "y" * 500)]), flush=True)
"""


def killed_while_writing(folder: Path, after: int) -> int:
    """Kill -9 a process that writes rows and says each number when it has it. Returns the last one said."""
    child = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE, text=True, env=child_environment()
    )
    assert child.stdout is not None
    said = 0
    for line in child.stdout:
        said = int(line)
        if after == 0:
            break
        after -= 1
    os.kill(child.pid, signal.SIGKILL)
    for line in child.stdout:
        if line.endswith("\n"):
            said = int(line)
    child.stdout.close()
    child.wait()
    return said


@pytest.mark.parametrize("kills", [20, pytest.param(500, marks=pytest.mark.slow)])
def test_no_acknowledged_row_is_lost_when_the_writer_is_killed(tmp_path: Path, kills: int) -> None:
    chance = random.Random(5)
    lost = 0
    for _ in range(kills):
        said = killed_while_writing(tmp_path, chance.randrange(8))
        verdict = verify(tmp_path)
        assert verdict.problem == ""
        lost += verdict.rows < said
    assert lost == 0
