"""The supervision state machine. Pure: it executes one table and refuses all other events with a reason."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from rolling_panda import reasons
from rolling_panda.messages.types import Mode, Reason
from rolling_panda.mode_table import MOVING, ROWS, SEVERITY, Event, Row, Who

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
#: Events that a mode already is the result of.
_REPEATED: Final[frozenset[tuple[Mode, Event]]] = frozenset(
    {("PROTECTIVE_STOP", Event.PROTECT), ("ESTOP_LATCHED", Event.STOP), ("FAULT", Event.FAULT)}
)
#: Refusal of an event that has no transition from a mode, with the step that has to come first.
IMPOSSIBLE: Final[dict[Mode, Callable[[str], Reason]]] = {
    "IDLE": reasons.impossible_in_idle,
    "READY": reasons.impossible_in_ready,
    "TELEOP": reasons.impossible_in_teleop,
    "AUTO": reasons.impossible_in_auto,
    "PAUSED": reasons.impossible_in_paused,
    "PROTECTIVE_STOP": reasons.impossible_in_protective_stop,
    "FAULT": reasons.impossible_in_fault,
    "ESTOP_LATCHED": reasons.impossible_in_estop,
}


@dataclass(frozen=True)
class State:
    """State of the machine.

    Attributes:
        mode: The mode.
        reason: Reason for the mode.
        clear_since: Time at which the cause of a PROTECTIVE_STOP or FAULT disappeared (s); None while it is present.
    """

    mode: Mode
    reason: Reason
    clear_since: float | None = None


@dataclass(frozen=True)
class Transition:
    """Result of an event: the state after it, and the reason of a refusal (None otherwise)."""

    state: State
    refused: Reason | None = None


def severity(mode: Mode) -> int:
    """Rank of a mode; of two faults at once the higher one wins."""
    return SEVERITY.index(mode)


def boot(stopped: Reason | None = None) -> State:
    """The state after a start: IDLE, or ESTOP_LATCHED with the reason of a stop that is still latched."""
    return State("IDLE", reasons.controller_started()) if stopped is None else State("ESTOP_LATCHED", stopped)


def step(state: State, event: Event, now: float, reason: Reason, by: Rights = SYSTEM) -> Transition:
    """Process an event.

    Args:
        state: State before it.
        event: The event.
        now: Monotonic time (s).
        reason: Reason; it becomes the reason of the new state.
        by: Who caused it.
    """
    row = _TABLE.get((state.mode, event))
    if row is None and event is Event.PROTECT and state.mode == "PROTECTIVE_STOP":
        # A new cause, or the old one again: the time without a cause starts again.
        return Transition(State("PROTECTIVE_STOP", reason))
    refused = refusal(state, event, now, by)
    return Transition(state if row is None or refused is not None else State(row.after, reason), refused)


def who(mode: Mode, event: Event | None) -> Who | None:
    """Who may cause an event in a mode; None where nobody can."""
    row = None if event is None else _TABLE.get((mode, event))
    return None if row is None else row.who


def refusal(state: State, event: Event, now: float, by: Rights) -> Reason | None:
    """Reason why an event is refused; None if it is taken, or repeats what the state is already.

    Args:
        state: State before it.
        event: The event.
        now: Monotonic time (s).
        by: Who causes it.
    """
    row = _TABLE.get((state.mode, event))
    if row is None:
        if (state.mode, event) in _REPEATED:
            return None
        if event is Event.FAULT:
            return reasons.fault_without_effect(state.mode)
        return IMPOSSIBLE[state.mode](event.value)
    if row.who not in by:
        return reasons.right_missing(event.value, state.mode, row.who)
    if event is Event.ACKNOWLEDGE:
        if state.clear_since is None:
            return reasons.cause_remains(state.reason)
        if now - state.clear_since < CLEAR_S:
            return reasons.cause_recent(CLEAR_S)
    return None


def observe(state: State, cause: Reason | None, now: float) -> State:
    """Note whether the cause of a PROTECTIVE_STOP or FAULT is still there."""
    if state.mode not in ("PROTECTIVE_STOP", "FAULT"):
        return state
    if cause is not None:
        return replace(state, clear_since=None) if state.clear_since is not None else state
    return replace(state, clear_since=now) if state.clear_since is None else state
