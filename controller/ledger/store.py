"""The ledger: an append-only table in which each row has the hash of the previous row.

SQLite with a write-ahead log and a flush to disk for each transaction. Rows survive `kill -9` and a power cut once
`append` has returned. A second file, the head, names the newest row, so that a missing end is detected.
"""

import contextlib
import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rolling_panda.closing import Closing
from rolling_panda.errors import LedgerError
from rolling_panda.runtime.state_folder import sync_folder

FILE = "ledger.sqlite"
HEAD = "ledger.head"
#: Hash before the first row.
ORIGIN = bytes(32)
SCHEMA = (
    "CREATE TABLE audit (number INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, kind TEXT NOT NULL, "
    "name TEXT NOT NULL, body TEXT NOT NULL, hash BLOB NOT NULL) STRICT",
    "CREATE INDEX newest ON audit (kind, name, number)",
    "CREATE TRIGGER no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, 'rows are never changed'); END",
    "CREATE TRIGGER no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'rows are never deleted'); END",
)
#: Form of tables and rows, as `PRAGMA user_version` of the file; the first files have 0. Up to 1 the state CUTTING of a
#: point was called INTENT; up to 2 reasons were text.
SCHEMA_VERSION = 3
#: Errors raised by a file that was changed from outside.
UNREADABLE = (sqlite3.Error, UnicodeDecodeError, TypeError)
_COLUMNS = "number, at, kind, name, body, hash"
#: A writer waits this long for another program that holds the file (s).
_BUSY_S = 0.5


@dataclass(frozen=True)
class Entry:
    """A new row: time (ISO 8601, UTC), kind, subject, and content as JSON."""

    at: str
    kind: str
    name: str
    body: str


@dataclass(frozen=True)
class Row:
    """A row of the ledger; `hash` binds it to the previous row."""

    number: int
    entry: Entry
    hash: bytes


class Ledger(Closing):
    """A ledger open for writing. Not thread-safe."""

    def __init__(self, folder: Path) -> None:
        """Open or begin the ledger in a folder.

        Raises:
            LedgerError: It cannot be opened, a newer version has written it, or its end is not as it was left.
        """
        self.path = folder / FILE
        self._head = folder / HEAD
        with _ledger_errors(self.path, "open"):
            # Created here, readable by its owner alone, whatever the umask is.
            os.close(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o600))
            self._database = sqlite3.connect(self.path, timeout=_BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            with _ledger_errors(self.path, "open"):
                self._prepare()
                sync_folder(folder)
            self._check_end()
            number, hashed = self._newest()
            if number == 0:
                self._point_head_at(number, hashed)
        except LedgerError:
            self._database.close()
            raise

    def append(self, entries: Iterable[Entry]) -> int:
        """Add rows in one transaction; they are on disk when this returns. Returns the newest row's number.

        Raises:
            LedgerError: None of them is in the ledger; it is as it was before.
        """
        with _ledger_errors(self.path, "write"):
            self._database.execute("BEGIN IMMEDIATE")
            # Commits at the end, or rolls back.
            with self._database:
                number, previous = self._newest()
                rows = []
                for entry in entries:
                    number += 1
                    previous = chained(previous, number, entry)
                    rows.append((number, entry.at, entry.kind, entry.name, entry.body, previous))
                self._database.executemany(f"INSERT INTO audit ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?)", rows)
        self._point_head_at(number, previous)
        return number

    def newest(self, kind: str) -> Iterator[tuple[str, str]]:
        """Name and body of the newest row of each name, of one kind, oldest first.

        Raises:
            LedgerError: It cannot be read.
        """
        with _ledger_errors(self.path, "read"):
            yield from self._database.execute(
                "SELECT name, body FROM audit WHERE number IN "
                "(SELECT max(number) FROM audit WHERE kind = ? GROUP BY name) ORDER BY number",
                (kind,),
            )

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _point_head_at(self, number: int, hashed: bytes) -> None:
        # One write of one length, so that a process that is killed leaves the old head or the new one. Not flushed:
        # after a power cut it may name an older row, which is in the chain all the same.
        with contextlib.suppress(OSError):
            descriptor = os.open(self._head, os.O_WRONLY | os.O_CREAT, 0o600)
            try:
                os.pwrite(descriptor, f"{number:020} {hashed.hex()}\n".encode("ascii"), 0)
            finally:
                os.close(descriptor)

    def _prepare(self) -> None:
        check_version(self._database, self.path)
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")
        self._database.execute("BEGIN IMMEDIATE")
        if not self._database.execute("SELECT 1 FROM sqlite_schema").fetchone():
            for statement in SCHEMA:
                self._database.execute(statement)
        if self._database.execute("PRAGMA user_version").fetchone() != (SCHEMA_VERSION,):
            self._database.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        self._database.execute("COMMIT")

    def _newest(self) -> tuple[int, bytes]:
        found = self._database.execute("SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1").fetchone()
        return (0, ORIGIN) if found is None else (int(found[0]), bytes(found[1]))

    def _check_end(self) -> None:
        """Refuse a ledger whose end is missing or whose newest row was changed."""
        problem = ""
        with _ledger_errors(self.path, "read"):
            rows = list(read(self._database, "ORDER BY number DESC LIMIT 2"))
            if rows:
                before = rows[1].hash if len(rows) > 1 else ORIGIN
                if chained(before, rows[0].number, rows[0].entry) != rows[0].hash:
                    problem = f"row {rows[0].number} is not as it was written"
            problem = problem or head_problem(self._database, read_head(self._head))
        if problem:
            raise LedgerError(
                f"{self.path} has been changed from outside: {problem}. See `rolling-panda audit verify`; "
                f"keep the folder as evidence, and give another one with --state"
            )


def chained(previous: bytes, number: int, entry: Entry) -> bytes:
    """Hash (32 bytes) of a row that follows the row with hash `previous`."""
    content = json.dumps([number, entry.at, entry.kind, entry.name, entry.body], ensure_ascii=False)
    return hashlib.sha256(previous + content.encode()).digest()


def read(database: sqlite3.Connection, rest: str = "ORDER BY number") -> Iterator[Row]:
    """Rows of an open ledger; `rest` ends the statement."""
    for number, at, kind, name, body, hashed in database.execute(f"SELECT {_COLUMNS} FROM audit {rest}"):
        yield Row(number, Entry(at, kind, name, body), hashed)


def check_version(database: sqlite3.Connection, path: Path) -> None:
    """Nothing is judged by this version's tables, or added to them, where a newer one has made others.

    Raises:
        LedgerError: It has.
    """
    (found,) = database.execute("PRAGMA user_version").fetchone()
    if found > SCHEMA_VERSION:
        raise LedgerError(
            f"the ledger {path} is of a newer version of this program: its schema is {found}, and this version knows "
            f"them up to {SCHEMA_VERSION}. Use that version, or give another folder with --state"
        )


def read_head(head: Path) -> str | OSError | ValueError:
    """Text of the head, or why there is none."""
    try:
        return head.read_text(encoding="ascii")
    except (OSError, ValueError) as error:
        return error


def head_problem(database: sqlite3.Connection, head: str | OSError | ValueError) -> str:
    """Reason why the row named by the head is missing; empty if it is there, or if the ledger is empty.

    Args:
        database: The ledger.
        head: From `read_head`, read before the rows are: a ledger that is being written gets its row first.
    """
    if isinstance(head, FileNotFoundError):
        return "" if database.execute("SELECT 1 FROM audit").fetchone() is None else f"{HEAD} is missing"
    try:
        if not isinstance(head, str):
            raise head
        number, hashed = head.split()
        if int(number) == 0:
            return "" if bytes.fromhex(hashed) == ORIGIN else f"{HEAD} is not as it was written"
        found = database.execute("SELECT hash FROM audit WHERE number = ?", (int(number),)).fetchone()
        same = found is not None and bytes(found[0]) == bytes.fromhex(hashed)
    except (OSError, ValueError, OverflowError) as error:
        return f"{HEAD} cannot be read: {error}"
    return "" if same else f"row {int(number)}, which {HEAD} names as the newest, is not in it"


@contextlib.contextmanager
def _ledger_errors(path: Path, what: str) -> Iterator[None]:
    try:
        yield
    except (*UNREADABLE, OSError) as error:
        raise LedgerError(f"cannot {what} the ledger {path}: {error}") from error
