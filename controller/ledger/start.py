"""Start of the controller: state restored from the ledger, and the first record."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from controller.ledger.journal import ApproachRow, OrderRow, PostureRow, PreviewRequiredRow, Record, TicketRow
from controller.ledger.store import Ledger
from rolling_panda import __version__
from rolling_panda.cli.about import About, about
from rolling_panda.errors import LedgerError
from rolling_panda.reasons import with_reason

Row = TypeVar("Row", bound=msgspec.Struct)


class StartRow(msgspec.Struct, frozen=True, kw_only=True):
    """Start of a process: version of program and Python, and the configuration."""

    program: About
    run_id: str
    config_sha256: str
    config: str


class _Version(msgspec.Struct, frozen=True):
    version: str


class _Start(msgspec.Struct, frozen=True):
    """The fields of a start record that all versions have."""

    program: _Version


def start_record(config: Path, run_id: str) -> Record:
    """The record of this start, with the whole configuration."""
    content = config.read_bytes()
    row = StartRow(
        program=about(),
        run_id=run_id,
        config_sha256=hashlib.sha256(content).hexdigest(),
        config=content.decode("utf-8", "replace"),
    )
    return Record(0, "start", "controller", row)


@dataclass(frozen=True)
class Restored:
    """State from the ledger: points, order of work, preview settings, approaches and saved postures."""

    tickets: tuple[TicketRow, ...] = ()
    order: OrderRow | None = None
    preview: PreviewRequiredRow | None = None
    approaches: tuple[tuple[str, ApproachRow], ...] = ()
    postures: tuple[tuple[str, PostureRow], ...] = ()


def restored(folder: Path) -> Restored:
    """The newest rows in the ledger of a folder.

    Raises:
        LedgerError: The ledger cannot be opened, or a row is not what this version writes.
    """
    with Ledger(folder) as ledger:
        orders, previews = _newest(ledger, "order", OrderRow), _newest(ledger, "preview", PreviewRequiredRow)
        approaches = [name for name, _ in ledger.newest("approach")]
        postures = [name for name, _ in ledger.newest("posture")]
        return Restored(
            tuple(_newest(ledger, "ticket", TicketRow)),
            orders[-1] if orders else None,
            previews[-1] if previews else None,
            tuple(zip(approaches, _newest(ledger, "approach", ApproachRow), strict=True)),
            tuple(zip(postures, _newest(ledger, "posture", PostureRow), strict=True)),
        )


def ticket_row(body: str) -> TicketRow:
    """A row of kind `ticket`, of this version or an earlier one.

    Raises:
        msgspec.MsgspecError: It is not what a version has written.
    """
    return msgspec.convert(_upgraded(msgspec.json.decode(body)), TicketRow)


def _newest(ledger: Ledger, kind: str, row: type[Row]) -> list[Row]:
    found = []
    for name, body in ledger.newest(kind):
        try:
            found.append(msgspec.convert(_upgraded(msgspec.json.decode(body)), row))
        except msgspec.MsgspecError as error:
            raise LedgerError(
                f"the ledger {ledger.path} tells of {kind} {name} what this version, {__version__}, does not "
                f"understand: {error}. It was last written by {_written_by(ledger)}: use that version, or keep the "
                f"folder and give another one with --state"
            ) from error
    return found


def _upgraded(body: Any) -> Any:
    """A decoded row in the form of this schema version."""
    if not isinstance(body, dict):
        return body
    if body.get("state") == "INTENT":
        body["state"] = "CUTTING"
    if body.get("reason") == "":
        del body["reason"]
    points = {name: with_reason(body[name]) for name in ("point", "accepted") if name in body}
    return with_reason(body | points)


def _written_by(ledger: Ledger) -> str:
    try:
        starts = [msgspec.json.decode(body, type=_Start) for _, body in ledger.newest("start")]
    except msgspec.MsgspecError:
        starts = []
    return f"version {starts[-1].program.version}" if starts else "a version that did not say which"
