"""Records of the controller and their durability. This part of the ledger has no files."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import msgspec

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import ArmAngles

#: Kind of a row: state of a point, order of work, approach, requirement of previews, saved posture, command of an
#: operator with its answer, stop, log line, start.
Kind = Literal["ticket", "order", "approach", "preview", "posture", "request", "stop", "event", "start"]


@dataclass(frozen=True)
class Record:
    """A row to be written. `number` increases with each record of one start; `name` identifies the subject."""

    number: int
    kind: Kind
    name: str
    body: msgspec.Struct


@dataclass(frozen=True)
class Records:
    """Output of a control step: rows for the ledger, in order."""

    rows: tuple[Record, ...]


@dataclass(frozen=True)
class LedgerState:
    """Durability of the records: all up to number `durable` are on disk. `failure` is the reason why others are not."""

    durable: int = 0
    failure: m.Reason | None = None


class TicketRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """State of a point. `hash` binds the acceptance; WITHDRAWN means that perception has withdrawn the point.

    `proposer` is the segmenter that proposed it, with the hash of its network; empty for a point by hand. `wrong_by` is
    who has said that the cut was wrong.
    """

    point: m.PruningPoint
    state: m.PointState | Literal["WITHDRAWN"]
    reason: m.Reason | None = None
    user: str = ""
    accepted: m.PruningPoint | None = None
    hash: str = ""
    cut_id: str = ""
    proposer: str = ""
    wrong_by: str = ""


class OrderRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Order of work set by `user`; empty for the plan's order. `revision` counts the changes by people."""

    order: tuple[str, ...]
    revision: int
    user: str = ""


class ApproachRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Turn of the approach about the cane (rad) that `user` has set; None leaves it to the posture search."""

    azimuth: float | None
    user: str = ""


class PreviewRequiredRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whether a cut needs an approved preview, and who set that."""

    required: bool
    user: str = ""


class PostureRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles of the arm's joints (7, rad) that `user` has saved; None for a posture that was deleted."""

    angles: ArmAngles | None
    user: str = ""


class RequestRow(msgspec.Struct, frozen=True, kw_only=True):
    """A command of an operator, and the reason of its refusal; None if it was done."""

    asked: intents.AnyIntent
    reason: m.Reason | None
    mode: m.Mode


class Journal:
    """Numbers records and knows which of them are durable. No clock: `now` is given."""

    def __init__(self) -> None:
        """Start with nothing to record."""
        self._waiting: list[Record] = []
        self._state = LedgerState()
        self._number = 0
        self._unwritten_since: float | None = None
        self._stops: deque[str] = deque(maxlen=100)

    @property
    def number(self) -> int:
        """Of the newest record."""
        return self._number

    @property
    def failure(self) -> m.Reason | None:
        """Reason why the ledger cannot record; None if it can."""
        return self._state.failure

    def add(self, kind: Kind, name: str, body: msgspec.Struct) -> int:
        """Record something; returns its number."""
        self._number += 1
        self._waiting.append(Record(self._number, kind, name, body))
        return self._number

    def stops(self, requests: Iterable[m.StopRequest]) -> None:
        """Record stops; each is sent several times."""
        for stop in requests:
            if stop.stop_id not in self._stops:
                self._stops.append(stop.stop_id)
                self.add("stop", stop.user or stop.source, stop)

    def drain(self) -> tuple[Record, ...]:
        """Return and remove the records since the last call, for the ledger."""
        records, self._waiting = tuple(self._waiting), []
        return records

    def observe(self, state: LedgerState, now: float) -> None:
        """Update the durability of the records."""
        if state.durable > self._state.durable or state.durable >= self._number:
            self._unwritten_since = None
        if state.durable < self._number and self._unwritten_since is None:
            self._unwritten_since = now
        self._state = state

    def holds(self, number: int) -> bool:
        """Is the record of this number durable?"""
        return number <= self._state.durable

    def trouble(self, now: float, patience_s: float) -> m.Reason | None:
        """Reason why the ledger is not reliable; None if it is."""
        if self._state.failure is not None:
            return self._state.failure
        if self._unwritten_since is not None and now - self._unwritten_since > patience_s:
            return reasons.ledger_silent(now - self._unwritten_since)
        return None


class EventLogger:
    """Collects log lines until they are drained. The current step or answer sets `now`."""

    def __init__(self, journal: Journal) -> None:
        """Start without lines. Lines are also recorded in the journal."""
        self._journal = journal
        self._events: list[m.LogEvent] = []
        self.now = 0.0

    def log(self, reason: m.Reason) -> None:
        """Add a line."""
        event = m.LogEvent(header=m.Header(self.now), process="controller", reason=reason)
        self._events.append(event)
        self._journal.add("event", "controller", event)

    def drain(self) -> tuple[m.LogEvent, ...]:
        """Return and remove the lines since the last call."""
        events, self._events = tuple(self._events), []
        return events
