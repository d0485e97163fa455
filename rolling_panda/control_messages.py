"""Who is there, who holds control of the robot's motion, and which stops are latched where."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.messages import Count, Message, NonNegative, Process, Role, Text

#: Who asks, as others may see it: a digest of a session, never the session itself. Empty = nobody.
ClientKey = Annotated[str, Meta(max_length=64)]
#: The random part of a token.
Nonce = Annotated[str, Meta(max_length=32, pattern=r"^[0-9a-f]*(?!\n)$")]
#: Seconds since 1970 on the clock of the process that says it, for people only.
WallTime = Annotated[float, Meta(ge=0.0, le=1e11)]
#: A view that has shown nothing yet counts as this old (s).
NEVER_SEEN_S = 1e6


class Person(Struct, frozen=True, forbid_unknown_fields=True):
    """Somebody whose page or script is heard from now.

    Attributes:
        key: Who.
        user: Their name.
        role: What they may do.
        heard_age_s: Since they last said something (s).
        view_age_s: Age of the newest state of the robot that they have drawn or fetched (s).
    """

    key: ClientKey
    user: Text
    role: Role
    heard_age_s: NonNegative
    view_age_s: NonNegative


class Presence(Message, frozen=True, kw_only=True):
    """Server → controller: who is there. It renews the lease of the one who holds control, from their last word on.

    Attributes:
        sequence: Strictly increasing; one that is not above the last counts for nothing.
        people: Everybody heard from within the last second.
    """

    sequence: Count
    people: tuple[Person, ...]


class ControlState(Message, frozen=True, kw_only=True):
    """Controller → all: the lease on the robot's motion.

    Attributes:
        holder: Key of who holds control, empty when nobody.
        user: Their name.
        epoch: Of the token that motion commands and cut orders carry now.
        expires_s: How long the lease still lives without a word of its holder (s).
        requested_by: Name of who asks for control, empty when nobody.
        requested_key: Their key.
        coming: Name of who gets control as soon as the robot is at rest, empty when nobody.
        told: What became of control last, in words.
        told_number: Grows with each such change, so that a page tells each once.
        supervised: Whether somebody who may operate sees the robot now.
    """

    holder: ClientKey
    user: Text
    epoch: Count
    expires_s: NonNegative
    requested_by: Text
    requested_key: ClientKey
    coming: Text
    told: Text
    told_number: Count
    supervised: bool


class StopRecord(Struct, frozen=True, forbid_unknown_fields=True):
    """One stop as a process has latched it.

    Attributes:
        stop_id: Its id.
        source: Process or input that it came from.
        user: Who pressed; empty where nobody did.
        reason: Why.
        wall_time: When this process latched it.
    """

    stop_id: Annotated[str, Meta(min_length=1, max_length=64)]
    source: Annotated[str, Meta(max_length=64)]
    user: Text
    reason: Text
    wall_time: WallTime


class StopState(Message, frozen=True, kw_only=True):
    """Bridge and controller → all: the stops that this process holds latched, the newest first.

    Attributes:
        process: Whose latch this is.
        stops: What is latched.
        released_by: Who released the last one that was, and why; empty before.
        hardware: Whether the hardware stop is pressed; always false from the controller.
    """

    process: Process
    stops: tuple[StopRecord, ...]
    released_by: Text = ""
    hardware: bool = False


class HardwareStop(Message, frozen=True, kw_only=True):
    """Anyone → the simulated bridge: press or release the robot's emergency stop button, which it does not have."""

    pressed: bool
    user: Text
