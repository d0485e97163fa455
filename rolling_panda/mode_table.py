"""The supervision machine as one table: what happens in which mode, where it leads, and who may cause it.

`controller/supervision/modes.py` steps it; the diagram and the table in `docs/safety.md` are made from it.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

from rolling_panda.messages.types import Mode

#: Who may cause a transition. `holder` holds the lease on the robot's motion, `system` is the program itself.
Who = Literal["system", "anyone", "operator", "holder", "supervisor"]

SEVERITY: Final[tuple[Mode, ...]] = (
    "IDLE",
    "READY",
    "TELEOP",
    "AUTO",
    "PAUSED",
    "PROTECTIVE_STOP",
    "FAULT",
    "ESTOP_LATCHED",
)
#: Modes in which somebody has told the robot to move.
MOVING: Final[tuple[Mode, ...]] = ("TELEOP", "AUTO")


class Event(Enum):
    """What can happen to the machine; the value is how a person would say it."""

    ARM = "arm"
    HOLD = "hold to move the tool"
    RELEASE = "release of the hold"
    START = "start"
    FINISHED = "end of the work"
    PAUSE = "pause"
    LOST = "loss of lease, supervisor or certainty"
    RESUME = "resume"
    PROTECT = "protective stop"
    ACKNOWLEDGE = "acknowledge"
    STOP = "stop"
    RESET = "reset"
    FAULT = "fault"


@dataclass(frozen=True)
class Row:
    """One transition that is taken; whatever is in no row is refused.

    Attributes:
        before: Mode in which it is possible.
        event: What causes it.
        after: Mode that it leads to.
        who: Who may cause it.
        when: What it takes beside that, in words.
    """

    before: Mode
    event: Event
    after: Mode
    who: Who
    when: str = ""


_PROTECT = "a limit, stale data, the link, or a robot that does not follow"
_CLEAR = "the cause is gone for 1 s"

ROWS: Final[tuple[Row, ...]] = (
    Row("IDLE", Event.ARM, "READY", "holder", "the robot's own data are fresh and the bridge follows"),
    Row("READY", Event.HOLD, "TELEOP", "holder", "pressed anew, with a view of the robot that is fresh"),
    Row("TELEOP", Event.RELEASE, "READY", "system", "let go, or silence"),
    Row("READY", Event.START, "AUTO", "holder", "a point is accepted and in reach, a supervisor is present"),
    Row("AUTO", Event.FINISHED, "READY", "system", "no accepted point in reach is left"),
    Row("AUTO", Event.PAUSE, "PAUSED", "operator"),
    Row("TELEOP", Event.PAUSE, "PAUSED", "operator"),
    Row("AUTO", Event.LOST, "PAUSED", "system", "lease, supervisor, server or perception lost, or a cut is UNKNOWN"),
    Row("TELEOP", Event.LOST, "PAUSED", "system", "lease or server lost"),
    Row("PAUSED", Event.RESUME, "READY", "holder", "starting is separate"),
    # READY moves too, while the arm is brought home.
    Row("READY", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("TELEOP", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("AUTO", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("PROTECTIVE_STOP", Event.ACKNOWLEDGE, "PAUSED", "holder", _CLEAR),
    Row("FAULT", Event.ACKNOWLEDGE, "IDLE", "supervisor", _CLEAR),
    Row("ESTOP_LATCHED", Event.RESET, "IDLE", "supervisor", "with a reason; the bridge has released it"),
    *(Row(mode, Event.FAULT, "FAULT", "system", "something that must hold does not") for mode in SEVERITY[:-2]),
    *(Row(mode, Event.STOP, "ESTOP_LATCHED", "anyone") for mode in SEVERITY[:-1]),
)

#: In a mode where something is not possible: what would have to come first.
FIRST: Final[dict[Mode, str]] = {
    "IDLE": "arm the robot first",
    "READY": "",
    "TELEOP": "release the hold first",
    "AUTO": "pause first",
    "PAUSED": "resume first",
    "PROTECTIVE_STOP": "acknowledge first",
    "FAULT": "acknowledge first",
    "ESTOP_LATCHED": "reset the stop first",
}
