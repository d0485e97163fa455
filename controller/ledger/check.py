"""Integrity check of a ledger: hash of each row, head and file structure."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from controller.ledger.store import (
    FILE,
    HEAD,
    ORIGIN,
    SCHEMA,
    UNREADABLE,
    Row,
    chained,
    check_version,
    head_problem,
    read,
    read_head,
)
from rolling_panda.errors import LedgerError


@dataclass(frozen=True)
class Verdict:
    """Result of a check.

    Attributes:
        rows: Number of intact rows from the first on.
        head: Hash of the last intact row.
        problem: First problem, as text; empty without one.
    """

    rows: int
    head: bytes
    problem: str


@contextmanager
def reading(folder: Path) -> Iterator[sqlite3.Connection]:
    """The ledger of a folder for reading, also while it is being written.

    Raises:
        LedgerError: There is none, or it cannot be read.
    """
    path = folder / FILE
    if not path.is_file():
        raise LedgerError(f"there is no ledger {path}; give the folder of the robot's state with --state")
    try:
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
    except sqlite3.Error as error:
        raise LedgerError(f"cannot read the ledger {path}: {error}") from error
    try:
        yield database
    except UNREADABLE as error:
        raise LedgerError(f"cannot read the ledger {path}: {error}") from error
    finally:
        database.close()


def verify(folder: Path, expected: bytes | None = None) -> Verdict:
    """Check a ledger.

    Args:
        folder: Of the robot's state.
        expected: Hash that was once noted as the newest; it must be in the chain.

    Raises:
        LedgerError: There is no ledger, or a newer version has written it.
    """
    count, head, met = 0, ORIGIN, expected is None or expected == ORIGIN
    with reading(folder) as database:
        try:
            # Before the rows, so that a row added during the check is not missed.
            newest = read_head(folder / HEAD)
            # One transaction: a consistent snapshot, whatever is added during the check.
            database.execute("BEGIN")
            check_version(database, folder / FILE)
            for row in read(database):
                problem = _row_problem(row, count + 1, head)
                if problem:
                    return Verdict(count, head, problem)
                count, head = count + 1, row.hash
                met = met or head == expected
            problem = _file_problem(database, count, newest)
        except UNREADABLE as error:
            problem = f"after row {count}: {error}"
    if not problem and not met and expected is not None:
        problem = f"no row has the hash {expected.hex()}: the end of the ledger is missing, or it is another one"
    return Verdict(count, head, problem)


def _row_problem(row: Row, number: int, previous: bytes) -> str:
    if row.number != number:
        return f"after row {number - 1} comes row {row.number}"
    if chained(previous, number, row.entry) != row.hash:
        return f"row {number} is not as it was written"
    return ""


def _file_problem(database: sqlite3.Connection, count: int, head: str | OSError | ValueError) -> str:
    statements = {sql for (sql,) in database.execute("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL")}
    if statements - {"CREATE TABLE sqlite_sequence(name,seq)"} != set(SCHEMA):
        return "its tables are not those of a ledger"
    told = database.execute("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").fetchone()
    if (0 if told is None else told[0]) != count:
        return f"{told and told[0]} rows were written, {count} are there"
    found = [str(line) for (line,) in database.execute("PRAGMA integrity_check(3)")]
    if found != ["ok"]:
        return f"the file is damaged: {'; '.join(found)}"
    return head_problem(database, head)
