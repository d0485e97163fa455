"""The timeline of a session, from the lines of the log: the same from the ledger and from a recording."""

from collections import deque
from typing import Final, Literal, get_args

from rolling_panda.messages.supervision import TIMELINE_EVENTS, Timeline, TimelineEvent
from rolling_panda.messages.types import LogEvent, Mode, Reason

_MODES: Final = {mode: mode for mode in get_args(Mode)}
_MODE = ("mode_changed", "robot_halted")
_CUT: Final[dict[str, Literal["cut", "failed_cut"]]] = {"cut_done": "cut", "cut_ended": "failed_cut"}
#: What the cutter itself reports; a close-up may decide otherwise.
_BY_CUTTER = ("cutter_cut", "cutter_missed", "cutter_unsure")
_REFUSAL = ("command_refused", "teleoperation_refused")


class TimelineBuilder:
    """Builds the `timeline` from log lines in their order. No clock: each line has its time."""

    def __init__(self) -> None:
        """Nothing has happened."""
        self._events: deque[TimelineEvent] = deque(maxlen=TIMELINE_EVENTS)
        self._count = 0
        #: By point: the cutter's report on its last cut, until the close-up has decided.
        self._reports: dict[str, TimelineEvent] = {}

    def add(self, at: float, line: LogEvent) -> bool:
        """Add a line with its time (s since 1970). Returns whether it is an event of the timeline."""
        event = event_of(at, line)
        if event is None:
            return False
        if line.reason.code in _CUT:
            self._supersede(event)
        self._events.append(event)
        self._count += 1
        return True

    def _supersede(self, event: TimelineEvent) -> None:
        """A cut is one event, though the cutter reports it before the close-up decides."""
        values = dict(event.reason.values)
        point, outcome = str(values.get("point")), values.get("outcome")
        earlier = self._reports.pop(point, None)
        if isinstance(outcome, Reason) and outcome.code in _BY_CUTTER:
            self._reports[point] = event
        elif earlier is not None and earlier in self._events:
            self._events.remove(earlier)
            self._count -= 1

    def timeline(self, began_at: float, ended_at: float) -> Timeline:
        """Everything up to now, of a session between these times (s since 1970)."""
        events = tuple(self._events)
        return Timeline(began_at=began_at, ended_at=ended_at, events=events, left_out=self._count - len(events))


def event_of(at: float, line: LogEvent) -> TimelineEvent | None:
    """The event that a line of the log tells of; None where it tells of none.

    Only the controller's lines count: it decides about modes, cuts and commands.
    """
    if line.process != "controller":
        return None
    reason = line.reason
    if reason.code in _MODE:
        # A recording may be of a version with other modes.
        before, mode = (_MODES.get(str(dict(reason.values).get(name))) for name in ("before", "after"))
        return TimelineEvent(at=at, kind="mode", reason=reason, before=before, mode=mode) if before and mode else None
    if reason.code in _CUT:
        return TimelineEvent(at=at, kind=_CUT[reason.code], reason=reason)
    if reason.code in _REFUSAL:
        return TimelineEvent(at=at, kind="refusal", reason=reason)
    return None
