"""Report and timeline of a session, built from durable ledger rows. No clock: each row has its time."""

from collections import deque
from collections.abc import Iterable
from datetime import datetime

import msgspec
from msgspec.structs import replace

from controller.ledger.journal import RequestRow, TicketRow
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages.supervision import (
    ControlReport,
    CutReport,
    RefusalReport,
    SessionReport,
    Timeline,
    VineReport,
)
from rolling_panda.timeline import TimelineBuilder

#: Largest number of each in the message; the ledger has all.
_MOST_CUTS, _MOST_REFUSALS, _MOST_CHANGES = 500, 100, 100
_ENDED = ("DONE", "FAILED_NOT_CUT", "UNKNOWN")
#: Commands that change who has control.
_CONTROL = (intents.TakeControl, intents.GrantControl, intents.ReturnControl)


class SessionReportBuilder:
    """Builds the `report` and the `timeline` from rows in their order."""

    def __init__(self) -> None:
        """Nothing has happened."""
        self._began = self._written = self._ready_since = 0.0
        self._cuts: dict[str, CutReport] = {}
        #: Accepted points without a cut so far; points that were given up before a cut.
        self._accepted: set[str] = set()
        self._given_up: set[str] = set()
        #: Vine of each accepted point that cannot be reached now.
        self._beyond: dict[str, int] = {}
        self._refusals: deque[RefusalReport] = deque(maxlen=_MOST_REFUSALS)
        self._control: deque[ControlReport] = deque(maxlen=_MOST_CHANGES)
        self._refused = 0
        self._timeline = TimelineBuilder()

    def add(self, at: str, body: msgspec.Struct) -> bool:
        """Add a row with its time (ISO 8601). Returns whether it changes the report or the timeline."""
        when = datetime.fromisoformat(at).timestamp()
        first = self._began == 0.0
        self._began, self._written = self._began or when, when
        # What ends before any work was started took no time.
        self._ready_since = self._ready_since or when
        match body:
            case TicketRow():
                return self._ticket(body, when) or first
            case m.LogEvent():
                return self._timeline.add(when, body) or first
            case RequestRow(reason=m.Reason() as reason):
                self._refused += 1
                asked = type(body.asked).__name__
                self._refusals.append(RefusalReport(at=when, user=body.asked.user, asked=asked, reason=reason))
            case RequestRow() if isinstance(body.asked, intents.Start):
                self._ready_since = when
            case RequestRow() if type(body.asked) in _CONTROL:
                asked = type(body.asked).__name__
                self._control.append(ControlReport(at=when, user=body.asked.user, asked=asked))
            case _:
                return first
        return True

    def report(self) -> SessionReport:
        """Everything up to now."""
        cuts = list(self._cuts.values())
        return SessionReport(
            began_at=self._began,
            written_at=self._written,
            cuts=tuple(cuts[-_MOST_CUTS:]),
            cut_count=len(cuts),
            vines=_by_vine(cuts, self._beyond.values()),
            refusals=tuple(self._refusals),
            refusal_count=self._refused,
            control=tuple(self._control),
        )

    def timeline(self) -> Timeline:
        """Everything up to now."""
        return self._timeline.timeline(self._began, self._written)

    def _ticket(self, row: TicketRow, when: float) -> bool:
        """Add a row; returns whether it changes the report. A point that is accepted again keeps its last cut id."""
        point_id = row.point.point_id
        before = self._beyond.pop(point_id, None)
        if row.state == "UNREACHABLE":
            self._beyond[point_id] = row.point.vine
        beyond = self._beyond.get(point_id) != before
        if row.state == "FAILED_NOT_CUT":
            if point_id in self._given_up:
                return beyond
            if point_id in self._accepted or not row.cut_id:
                self._give_up(row, when)
                return True
        self._given_up.discard(point_id)
        if row.state == "ACCEPTED":
            self._accepted.add(point_id)
        else:
            self._accepted.discard(point_id)
        if not row.cut_id:
            return beyond
        self._cut(row, when)
        return True

    def _cut(self, row: TicketRow, when: float) -> None:
        known = self._cuts.get(row.cut_id)
        if row.state == "CUTTING":
            point = row.point
            # A second try takes the place of the first.
            tries = [key for key, cut in self._cuts.items() if cut.point_id == point.point_id and not cut.outcome]
            earlier = sum(self._cuts.pop(key).seconds for key in tries)
            # From one order to the next: whether it was cut is seen on the way to the next one.
            self._cuts[row.cut_id] = CutReport(
                cut_id=row.cut_id,
                point_id=point.point_id,
                vine=point.vine,
                spur=point.spur,
                user=row.user,
                seconds=earlier + max(when - self._ready_since, 0.0),
            )
            self._ready_since = when
        elif known is not None and row.state in _ENDED:
            # A person may report another outcome later.
            ended = known.ended_at if known.outcome else when
            self._cuts[row.cut_id] = replace(
                known, outcome=row.state, reason=row.reason, wrong_by=row.wrong_by, ended_at=ended
            )

    def _give_up(self, row: TicketRow, when: float) -> None:
        point = row.point
        self._given_up.add(point.point_id)
        self._cuts[f"{point.point_id} given up at {when}"] = CutReport(
            point_id=point.point_id,
            vine=point.vine,
            spur=point.spur,
            outcome="FAILED_NOT_CUT",
            reason=row.reason,
            user=row.user,
            ended_at=when,
            seconds=max(when - self._ready_since, 0.0),
        )
        self._ready_since = when


def _by_vine(cuts: list[CutReport], beyond: Iterable[int]) -> tuple[VineReport, ...]:
    vines: dict[int, VineReport] = {}
    for cut in cuts:
        vine = vines.get(cut.vine, VineReport(vine=cut.vine))
        vines[cut.vine] = replace(
            vine,
            done=vine.done + (cut.outcome == "DONE"),
            not_cut=vine.not_cut + (cut.outcome == "FAILED_NOT_CUT"),
            unknown=vine.unknown + (cut.outcome == "UNKNOWN"),
            seconds=vine.seconds + cut.seconds,
        )
    for number in beyond:
        vine = vines.get(number, VineReport(vine=number))
        vines[number] = replace(vine, unreachable=vine.unreachable + 1)
    return tuple(vines[number] for number in sorted(vines))
