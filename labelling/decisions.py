"""What people decided about pruning points, as the ledger tells it."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

import msgspec

from controller.ledger.check import reading, verify
from controller.ledger.journal import TicketRow
from controller.ledger.start import ticket_row
from controller.ledger.store import FILE, check_version, read
from rolling_panda import messages as m
from rolling_panda.errors import InputError

#: `cut`: the robot has seen the cane severed; `stood`, `was cut`: a person has looked after an unknown cut; `wrong`: a
#: person has said afterwards that it should not have been cut there.
DecisionKind = Literal["accepted", "rejected", "moved", "placed by hand", "cut", "stood", "was cut", "wrong"]
_BOUND = ("ACCEPTED", "UNREACHABLE", "CUTTING")


@dataclass(frozen=True)
class Decision:
    """A decision about a point.

    Attributes:
        kind: What was decided.
        at: Unix time (s).
        point: As it was decided on; its position is in odom (m).
        reason: Of the state; None without one.
        proposer: Segmenter that proposed the point, with the hash of its network; empty if the ledger does not tell.
    """

    kind: DecisionKind
    at: float
    point: m.PruningPoint
    reason: m.Reason | None
    proposer: str = ""


def read_decisions(state: Path) -> tuple[list[Decision], int]:
    """Decisions in order of time, and how many were taken back and are left out.

    Args:
        state: Folder of a robot's state, or the ledger in it.

    Raises:
        InputError: The ledger was changed from outside, or a row cannot be read.
        LedgerError: There is none, or a newer version has written it.
    """
    folder = state.parent if state.name == FILE else state
    verdict = verify(folder)
    if verdict.problem:
        raise InputError(
            f"{folder / FILE} is not as it was written: {verdict.problem}. See `rolling-panda audit verify`"
        )
    with reading(folder) as database:
        check_version(database, folder / FILE)
        rows = [(row.entry.at, row.entry.name, row.entry.body) for row in read(database, "WHERE kind = 'ticket'")]
    decisions: list[Decision] = []
    before: dict[str, TicketRow] = {}
    taken_back = 0
    for at, name, body in rows:
        try:
            row, time = ticket_row(body), datetime.fromisoformat(at).timestamp()
        except (msgspec.MsgspecError, ValueError) as error:
            raise InputError(f"{folder / FILE} holds a row of {name} that cannot be read: {error}") from error
        old = before.get(name)
        before[name] = row
        if row.state == "PROPOSED" and row.user and old is not None and old.state in (*_BOUND, "REJECTED"):
            last = next((at for at in reversed(range(len(decisions))) if _can_be_taken_back(decisions[at], name)), None)
            # An acceptance that became void has a reason; it was made all the same.
            if row.reason is None and last is not None:
                del decisions[last]
                taken_back += 1
            continue
        if old is not None and old.wrong_by and not row.wrong_by:
            decisions = [each for each in decisions if not (each.kind == "wrong" and each.point.point_id == name)]
            taken_back += 1
        point = row.accepted or row.point
        decisions += [Decision(kind, time, point, row.reason, row.proposer) for kind in _kinds(row, old)]
    return decisions, taken_back


def _can_be_taken_back(decision: Decision, name: str) -> bool:
    return decision.point.point_id == name and decision.kind in ("accepted", "rejected")


def _kinds(row: TicketRow, old: TicketRow | None) -> list[DecisionKind]:
    """What a row of a point decides after the row before."""
    kinds: list[DecisionKind] = []
    if row.point.kind == "by hand" and (old is None or old.point.kind != "by hand"):
        kinds.append("placed by hand" if old is None else "moved")
    state = "" if old is None else old.state
    if row.state == "ACCEPTED" and row.user and state not in _BOUND and row.reason is None:
        kinds.append("accepted")
    elif row.state == "REJECTED" and row.user and state != "REJECTED":
        kinds.append("rejected")
    elif row.reason is not None and row.reason.code == "inspected" and row.state in ("DONE", "FAILED_NOT_CUT"):
        kinds.append("was cut" if row.state == "DONE" else "stood")
    elif row.state == "DONE" and state != "DONE":
        kinds.append("cut")
    if row.wrong_by and not (old is not None and old.wrong_by):
        kinds.append("wrong")
    return kinds
