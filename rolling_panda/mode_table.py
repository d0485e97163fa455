"""The supervision state machine as one table of transitions.

`controller/supervision/modes.py` executes it. The diagram and the table in `docs/safety.md` are generated from it.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

from rolling_panda.messages.types import Mode

#: Who may cause a transition. `holder` has the lease on the robot's motion, `system` is the program itself.
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
#: Modes in which the robot moves by command of a person.
MOVING: Final[tuple[Mode, ...]] = ("TELEOP", "AUTO")


class Event(Enum):
    """An event of the state machine; the value is its name in texts."""

    ARM = "arm"
    HOLD = "hold to move the tool"
    RELEASE = "release of the hold"
    START = "start"
    FINISHED = "end of the work"
    PAUSE = "pause"
    LOST = "loss of lease, operator or certainty"
    RESUME = "resume"
    PROTECT = "protective stop"
    ACKNOWLEDGE = "acknowledge"
    STOP = "stop"
    RESET = "reset"
    FAULT = "fault"


@dataclass(frozen=True)
class Row:
    """One allowed transition; every other one is refused.

    Attributes:
        before: Mode before it.
        event: Its trigger.
        after: Mode after it.
        who: Who may cause it.
        when: Further condition, as text.
    """

    before: Mode
    event: Event
    after: Mode
    who: Who
    when: str = ""


_PROTECT = "limit violated, contact felt, data stale, connection lost, or tracking error too large"
_CLEAR = "the cause has been gone for 1 s"

ROWS: Final[tuple[Row, ...]] = (
    Row("IDLE", Event.ARM, "READY", "holder", "joint states and odometry are fresh, and the bridge follows"),
    Row("READY", Event.HOLD, "TELEOP", "holder", "pressed again, and the page's view of the robot is fresh"),
    Row("TELEOP", Event.RELEASE, "READY", "system", "released, or not renewed"),
    Row("READY", Event.START, "AUTO", "holder", "an accepted point is in reach, and an operator is present"),
    Row("AUTO", Event.FINISHED, "READY", "system", "no accepted point is left in reach"),
    Row("AUTO", Event.PAUSE, "PAUSED", "operator"),
    Row("TELEOP", Event.PAUSE, "PAUSED", "operator"),
    Row("AUTO", Event.LOST, "PAUSED", "system", "lease, operator, server or perception lost, or a cut is UNKNOWN"),
    Row("TELEOP", Event.LOST, "PAUSED", "system", "lease or server lost"),
    Row("PAUSED", Event.RESUME, "READY", "holder", "work does not start"),
    # The robot also moves in READY, during homing.
    Row("READY", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("TELEOP", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("AUTO", Event.PROTECT, "PROTECTIVE_STOP", "system", _PROTECT),
    Row("PROTECTIVE_STOP", Event.ACKNOWLEDGE, "PAUSED", "holder", _CLEAR),
    Row("FAULT", Event.ACKNOWLEDGE, "IDLE", "supervisor", _CLEAR),
    Row("ESTOP_LATCHED", Event.RESET, "IDLE", "supervisor", "with a reason; the bridge has released the stop"),
    *(Row(mode, Event.FAULT, "FAULT", "system", "an invariant is violated") for mode in SEVERITY[:-2]),
    *(Row(mode, Event.STOP, "ESTOP_LATCHED", "anyone") for mode in SEVERITY[:-1]),
)
