"""The supervision state machine: pure, one table, everything unlisted refused with a reason in words."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from rolling_panda.messages import Mode

#: How long the cause of a protective stop must be gone before it can be acknowledged (s).
CLEAR_S: Final = 1.0
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


class Event(Enum):
    """What can happen to the machine; the value is how a person would say it."""

    ARM = "arm"
    HOLD = "hold to move the tool"
    RELEASE = "release of the hold"
    START = "start"
    FINISHED = "end of the work"
    PAUSE = "pause"
    RESUME = "resume"
    PROTECT = "protective stop"
    ACKNOWLEDGE = "acknowledge"
    STOP = "stop"
    RESET = "reset"
    FAULT = "fault"


@dataclass(frozen=True)
class State:
    """Where the machine is.

    Attributes:
        mode: Its mode.
        reason: Why it is there, in words.
        clear_since: When the cause of a PROTECTIVE_STOP or FAULT went away (s); None while it is there.
    """

    mode: Mode
    reason: str
    clear_since: float | None = None


@dataclass(frozen=True)
class Transition:
    """What came of an event: the state after it, and why it was refused (empty when it was taken)."""

    state: State
    refused: str = ""


_TABLE: Final[dict[tuple[Mode, Event], Mode]] = {
    ("IDLE", Event.ARM): "READY",
    ("READY", Event.HOLD): "TELEOP",
    ("TELEOP", Event.RELEASE): "READY",
    ("READY", Event.START): "AUTO",
    ("AUTO", Event.FINISHED): "READY",
    ("AUTO", Event.PAUSE): "PAUSED",
    ("TELEOP", Event.PAUSE): "PAUSED",
    ("PAUSED", Event.RESUME): "READY",
    ("AUTO", Event.PROTECT): "PROTECTIVE_STOP",
    ("TELEOP", Event.PROTECT): "PROTECTIVE_STOP",
    # READY moves too, while the arm is brought home.
    ("READY", Event.PROTECT): "PROTECTIVE_STOP",
    ("PROTECTIVE_STOP", Event.ACKNOWLEDGE): "PAUSED",
    ("FAULT", Event.ACKNOWLEDGE): "IDLE",
    ("ESTOP_LATCHED", Event.RESET): "IDLE",
}
_NEXT: Final[dict[Mode, str]] = {
    "IDLE": "arm the robot first",
    "READY": "",
    "TELEOP": "release the hold first",
    "AUTO": "pause first",
    "PAUSED": "resume first",
    "PROTECTIVE_STOP": "acknowledge first",
    "FAULT": "acknowledge first",
    "ESTOP_LATCHED": "reset the stop first",
}


def severity(mode: Mode) -> int:
    """Rank of a mode; of two faults at once the higher one wins."""
    return SEVERITY.index(mode)


def boot(stopped: str = "") -> State:
    """The state after a start: IDLE, or ESTOP_LATCHED with the reason of a stop that is still latched."""
    return State("ESTOP_LATCHED", stopped) if stopped else State("IDLE", "started; nothing moves until it is armed")


def step(state: State, event: Event, now: float, reason: str = "") -> Transition:
    """What an event does.

    Args:
        state: Before it.
        event: What happened.
        now: Monotonic time (s).
        reason: Why, in words; becomes the reason of the new state.
    """
    if event is Event.STOP:
        return _enter(state, "ESTOP_LATCHED", reason or "stopped")
    if event is Event.FAULT:
        return _enter(state, "FAULT", reason or "fault")
    if event is Event.PROTECT and state.mode == "PROTECTIVE_STOP":
        return Transition(State("PROTECTIVE_STOP", reason or state.reason))
    target = _TABLE.get((state.mode, event))
    if target is None:
        advice = _NEXT[state.mode]
        return Transition(state, f"{event.value} is not possible in {state.mode}" + (f": {advice}" if advice else ""))
    if event is Event.ACKNOWLEDGE:
        if state.clear_since is None:
            return Transition(state, f"the cause is still there: {state.reason}")
        if now - state.clear_since < CLEAR_S:
            return Transition(state, f"the cause must be gone for {CLEAR_S:.0f} s first")
    return Transition(State(target, reason or event.value))


def observe(state: State, cause: str, now: float) -> State:
    """Note whether the cause of a PROTECTIVE_STOP or FAULT is still there (`cause` not empty)."""
    if state.mode not in ("PROTECTIVE_STOP", "FAULT"):
        return state
    if cause:
        return replace(state, clear_since=None) if state.clear_since is not None else state
    return replace(state, clear_since=now) if state.clear_since is None else state


def _enter(state: State, mode: Mode, reason: str) -> Transition:
    if severity(state.mode) > severity(mode):
        return Transition(state, f"{mode} changes nothing: the robot is in {state.mode}")
    if state.mode == mode:
        return Transition(state)
    return Transition(State(mode, reason))
