"""What a start reads from the ledger and writes into it first."""

import hashlib
from pathlib import Path

import msgspec

from controller.journal import OrderRow, Record, TicketRow
from controller.ledger import Ledger
from rolling_panda.about import About, about
from rolling_panda.errors import LedgerError


class StartRow(msgspec.Struct, frozen=True, kw_only=True):
    """A process has started: which program on which Python, and with which configuration."""

    program: About
    run_id: str
    config_sha256: str
    config: str


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


def restored(folder: Path) -> tuple[tuple[TicketRow, ...], OrderRow | None]:
    """The newest row of each point in the ledger of a folder, and the order of work if people have put one.

    Raises:
        LedgerError: The ledger cannot be opened, or a row is not what this version writes.
    """
    with Ledger(folder) as ledger:
        found: list[TicketRow] = []
        order: OrderRow | None = None
        told = [(kind, *row) for kind in ("ticket", "order") for row in ledger.newest(kind)]
        for kind, name, body in told:
            try:
                if kind == "ticket":
                    found.append(msgspec.json.decode(body, type=TicketRow))
                else:
                    order = msgspec.json.decode(body, type=OrderRow)
            except msgspec.MsgspecError as error:
                raise LedgerError(
                    f"the ledger {ledger.path} tells of {kind} {name} what this version does not understand: {error}; "
                    f"keep the folder, and give another one with --state"
                ) from error
        return tuple(found), order
