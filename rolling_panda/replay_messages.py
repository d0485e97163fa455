"""A recording that is played to the page: where it stands, and what is asked of it."""

from typing import Annotated

from msgspec import Meta

from rolling_panda.messages import Message, NonNegative, Text

#: Seconds since 1970, of people's clocks.
WallTime = Annotated[float, Meta(ge=0.0, le=1e11)]


class ReplayState(Message, frozen=True, kw_only=True):
    """Replay → server: what is on the wire is a recording.

    Attributes:
        name: Of the file.
        begins_at: When its first message was recorded (s since 1970).
        duration_s: From the first to the last message.
        position_s: Where it is played now, from its beginning.
        playing: False while it stands still.
    """

    name: Text
    begins_at: WallTime
    duration_s: NonNegative
    position_s: NonNegative
    playing: bool


class SeekReplay(Message, frozen=True, kw_only=True):
    """Server → replay: go on from `position_s` (s from the beginning; None from where it is), or stand still there."""

    position_s: NonNegative | None = None
    playing: bool = True
