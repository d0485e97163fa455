"""The supervision state machine. Pure: it executes one table and refuses all other events with a reason."""

from dataclasses import dataclass, replace
from typing import Final

from rolling_panda.messages.types import Mode
from rolling_panda.mode_table import FIRST, MOVING, ROWS, SEVERITY, Event, Row, Who

__all__ = [
    "ANYBODY",
    "MOVING",
    "OPERATOR",
    "SEVERITY",
    "SYSTEM",
    "Event",
    "Rights",
    "State",
    "Transition",
    "Who",
    "boot",
]

#: Time without the cause of a protective stop before it can be acknowledged (s).
CLEAR_S: Final = 1.0

#: Rights of a person: the kinds of causer that they count as.
Rights = frozenset[Who]
#: The program itself.
SYSTEM: Final[Rights] = frozenset({"system", "anyone"})
#: A person who may only stop.
ANYBODY: Final[Rights] = frozenset({"anyone"})
#: A supervisor who holds control.
OPERATOR: Final[Rights] = frozenset({"anyone", "operator", "holder", "supervisor"})

_TABLE: Final[dict[tuple[Mode, Event], Row]] = {(row.before, row.event): row for row in ROWS}
_WANTED: Final[dict[Who, str]] = {
    "system": "the program itself",
    "anyone": "anybody",
    "operator": "an operator",
    "holder": "who holds control",
    "supervisor": "a supervisor",
}


@dataclass(frozen=True)
class State:
    """State of the machine.

    Attributes:
        mode: The mode.
        reason: Reason for the mode, as text.
        clear_since: Time at which the cause of a PROTECTIVE_STOP or FAULT disappeared (s); None while it is present.
    """

    mode: Mode
    reason: str
    clear_since: float | None = None


@dataclass(frozen=True)
class Transition:
    """Result of an event: the state after it, and the reason of a refusal (empty otherwise)."""

    state: State
    refused: str = ""


def severity(mode: Mode) -> int:
    """Rank of a mode; of two faults at once the higher one wins."""
    return SEVERITY.index(mode)


def boot(stopped: str = "") -> State:
    """The state after a start: IDLE, or ESTOP_LATCHED with the reason of a stop that is still latched."""
    return State("ESTOP_LATCHED", stopped) if stopped else State("IDLE", "started; nothing moves until it is armed")


def step(state: State, event: Event, now: float, reason: str = "", by: Rights = SYSTEM) -> Transition:
    """Process an event.

    Args:
        state: State before it.
        event: The event.
        now: Monotonic time (s).
        reason: Reason, as text; it becomes the reason of the new state.
        by: Who caused it.
    """
    row = _TABLE.get((state.mode, event))
    if row is None:
        return _unlisted(state, event, reason)
    if row.who not in by:
        return Transition(state, f"{event.value} in {state.mode} is for {_WANTED[row.who]}")
    if event is Event.ACKNOWLEDGE:
        if state.clear_since is None:
            return Transition(state, f"the cause is still there: {state.reason}")
        if now - state.clear_since < CLEAR_S:
            return Transition(state, f"the cause must be gone for {CLEAR_S:.0f} s first")
    return Transition(State(row.after, reason or event.value))


def observe(state: State, cause: str, now: float) -> State:
    """Note whether the cause of a PROTECTIVE_STOP or FAULT is still there (`cause` not empty)."""
    if state.mode not in ("PROTECTIVE_STOP", "FAULT"):
        return state
    if cause:
        return replace(state, clear_since=None) if state.clear_since is not None else state
    return replace(state, clear_since=now) if state.clear_since is None else state


def _unlisted(state: State, event: Event, reason: str) -> Transition:
    """Result of an event that has no transition from this mode."""
    if event is Event.PROTECT and state.mode == "PROTECTIVE_STOP":
        # A new cause, or the old one again: the time without a cause starts again.
        return Transition(State("PROTECTIVE_STOP", reason or state.reason))
    if event is Event.STOP or (event is Event.FAULT and state.mode == "FAULT"):
        return Transition(state)
    if event is Event.FAULT:
        return Transition(state, f"a fault changes nothing: the robot is in {state.mode}")
    advice = FIRST[state.mode]
    return Transition(state, f"{event.value} is not possible in {state.mode}" + (f": {advice}" if advice else ""))
