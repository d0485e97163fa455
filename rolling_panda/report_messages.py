"""The session's report: what was cut, how long it took, what was refused, and who held control."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.control_messages import ClientKey, WallTime
from rolling_panda.messages import Count, Message, Name, NonNegative, Outcome, Text

_Number = Annotated[int, Meta(ge=0, le=100000)]


class CutReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One cut and how it ended, or a point that was given up before the blades were asked to close.

    Attributes:
        cut_id: Of the cut; empty where the point was given up before there was one.
        point_id: Point that was to be cut.
        vine: Its vine.
        spur: Its spur on that vine.
        outcome: As it is known now; empty while it goes on.
        reason: In words.
        user: Who accepted it, or said how it ended.
        ended_at: When; 0 while it goes on.
        seconds: From the end of the cut before, or the start of work if that was later, to the end of this one.
    """

    cut_id: ClientKey = ""
    point_id: Name
    vine: _Number
    spur: _Number
    outcome: Outcome = ""
    reason: Text = ""
    user: Text = ""
    ended_at: WallTime = 0.0
    seconds: NonNegative = 0.0


class VineReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The cuts of one vine by outcome, and the time they took together (s)."""

    vine: _Number
    done: Count = 0
    not_cut: Count = 0
    unknown: Count = 0
    seconds: NonNegative = 0.0


class RefusalReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What somebody asked for and did not get: when, who, what, and why."""

    at: WallTime
    user: Text
    asked: Text
    reason: Text


class ControlReport(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Somebody took, granted or returned control: when, who, and what."""

    at: WallTime
    user: Text
    what: Text


class SessionReport(Message, frozen=True, kw_only=True):
    """Controller → all: what has happened since it started, as far as it is on disk.

    Attributes:
        began_at: When the controller started.
        written_at: When the newest row of the ledger was written that is in here.
        cuts: The newest cuts, oldest first.
        cut_count: All cuts, those left out of `cuts` too.
        vines: Each vine with a cut, by its number; all cuts count.
        refusals: The newest refusals.
        refusal_count: All of them.
        control: The newest changes of control.
    """

    began_at: WallTime
    written_at: WallTime
    cuts: tuple[CutReport, ...] = ()
    cut_count: Count = 0
    vines: tuple[VineReport, ...] = ()
    refusals: tuple[RefusalReport, ...] = ()
    refusal_count: Count = 0
    control: tuple[ControlReport, ...] = ()
