"""Ledger writer on its own thread. The control loop never waits for it."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from typing import Protocol

import msgspec

from controller.ledger.journal import LedgerState, Record
from controller.ledger.session_report import SessionReportBuilder
from controller.ledger.store import Entry
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.errors import LedgerError
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.runtime.token_bucket import TokenBucket

#: Period of the retries after a failure (s).
_AGAIN_S = 0.5
#: Time limit for the last records at the end (s).
_END_S = 2.0
#: Rows in one transaction, at most.
_BATCH = 500
#: Rate limit of other processes' log lines: burst, and lines a second. A client that makes the server
#: refuse a thousand requests a second must not fill the disk.
_LINES_AT_ONCE = 200.0
_LINES_A_SECOND = 20.0


class Store(Protocol):
    """Destination of the records."""

    def append(self, entries: Iterable[Entry]) -> int:
        """Add rows durably, all or none."""

    def close(self) -> None:
        """Let go of it."""


class LedgerWriter:
    """Writes the records passed to `write` and `note`. `state` has their durability. Close it at the end."""

    def __init__(self, open_store: Callable[[], Store], clock: Callable[[], float] = time.monotonic) -> None:
        """Start the thread, which opens the ledger and keeps trying while it cannot."""
        self._open, self._clock = open_store, clock
        self._waiting: deque[tuple[str, Record]] = deque()
        self._some = threading.Condition()
        self._closing = False
        self._state = LedgerState()
        self._account = SessionReportBuilder()
        #: Report and timeline of the durable rows, rebuilt on the writer's thread when they change.
        self.report, self.timeline = self._account.report(), self._account.timeline()
        self._lines, self._left_out = TokenBucket(_LINES_A_SECOND, _LINES_AT_ONCE), 0
        self._thread = threading.Thread(target=self._run, name="ledger", daemon=True)
        self._thread.start()

    @property
    def state(self) -> LedgerState:
        """How far the ledger is."""
        return self._state

    def write(self, records: Iterable[Record]) -> None:
        """Record these, in this order; returns at once."""
        added = [(_now(), record) for record in records]
        if added:
            with self._some:
                self._waiting.extend(added)
                self._some.notify()

    def note(self, line: m.LogEvent) -> None:
        """Record a line of another process's log; returns at once. Too many are counted instead."""
        if not self._lines.take(self._clock()):
            self._left_out += 1
            return
        if self._left_out:
            left_out = reasons.lines_unrecorded(self._left_out)
            event = m.LogEvent(header=line.header, process="controller", reason=left_out)
            self.write([Record(0, "event", "controller", event)])
            self._left_out = 0
        self.write([Record(0, "event", line.process, line)])

    def close(self) -> None:
        """Write the waiting records within the time limit, and close the ledger."""
        with self._some:
            self._closing = True
            self._some.notify()
        self._thread.join(_END_S)

    def _run(self) -> None:
        # Scheduling is per thread: the disk must not delay the control loop.
        set_priority("interface")
        store: Store | None = None
        while True:
            batch = self._next()
            if not batch:
                break
            try:
                store = store or self._open()
                store.append(_entry(at, record) for at, record in batch)
            except LedgerError as error:
                self._state = LedgerState(self._state.durable, reasons.ledger_failed(str(error)))
                with self._some:
                    if self._closing:
                        break
                    self._some.wait(_AGAIN_S)
                continue
            with self._some:
                for _ in batch:
                    self._waiting.popleft()
            if any([self._account.add(at, record.body) for at, record in batch]):
                self.report, self.timeline = self._account.report(), self._account.timeline()
            self._state = LedgerState(max([self._state.durable, *(record.number for _, record in batch)]))
        if store is not None:
            store.close()

    def _next(self) -> list[tuple[str, Record]]:
        """The records to write next, which stay at the head of those that wait; none when it is time to end."""
        with self._some:
            while not self._waiting and not self._closing:
                self._some.wait()
            return [self._waiting[index] for index in range(min(_BATCH, len(self._waiting)))]


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")


def _entry(at: str, record: Record) -> Entry:
    return Entry(at, record.kind, record.name, msgspec.json.encode(record.body).decode())
