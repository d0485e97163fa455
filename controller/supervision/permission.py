"""Permission of each command in the present state, with the reason of a refusal."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from controller.config import SupervisionConfig
from controller.supervision import health as safety
from controller.supervision import modes
from controller.supervision.modes import Event
from rolling_panda import reasons
from rolling_panda.commands import COMMANDS, Command, Condition
from rolling_panda.messages.types import Mode, Reason


@dataclass(frozen=True)
class Situation:
    """State that a permission depends on.

    Attributes:
        config: Section `[controller.supervision]`.
        state: State of the supervision state machine.
        health: Health of the inputs.
        homing: True during homing.
        busy: Action that blocks a new motion; None when none.
        work: Reason why each condition of the work does not hold; None when it does.
        rights: Rights of the client.
        not_theirs: Reason why the client may not move the robot; None when it may.
        unwatched: Reason why automatic work lacks an attentive operator; None when it has one.
    """

    config: SupervisionConfig
    state: modes.State
    health: safety.Health
    homing: bool
    busy: Reason | None
    work: Mapping[Condition, Reason | None] = field(default_factory=dict)
    rights: modes.Rights = modes.ANYBODY
    not_theirs: Reason | None = None
    unwatched: Reason | None = None


#: Name of motion by hand, which is asked for by a stream of targets rather than by a command.
HOLD: Final = "Teleoperation"
_OF_HOLDER: Final = (*(command.name for command in COMMANDS if command.control), HOLD)

#: What only a supervisor may do in a mode.
OF_SUPERVISOR: Final[dict[Mode, tuple[str, ...]]] = {
    mode: tuple(each.name for each in COMMANDS if "supervisor" in (each.role, modes.who(mode, each.event)))
    for mode in modes.SEVERITY
}

#: Check of each condition of the robot: the reason why it does not hold, None if it does.
_CHECKS: Final[dict[Condition, Callable[[Situation], Reason | None]]] = {
    "fresh sensors": lambda now: safety.sensors(now.health, now.config),
    "bridge obeys": lambda now: reasons.watchdog_holds() if now.health.watchdog else None,
    "server": lambda now: safety.supervision(now.health, now.config, False),
    "at rest": lambda now: now.busy,
    "perception": lambda now: safety.perception(now.health, now.config),
    "watched": lambda now: now.unwatched,
}


def refusal(command: Command, now: float, situation: Situation) -> Reason | None:
    """Reason why a command is refused now whatever its arguments are; None if it is allowed.

    Args:
        command: Row of the table.
        now: Monotonic time (s).
        situation: Of the robot.
    """
    mode, event = situation.state.mode, command.event
    if "operator" not in situation.rights:
        return situation.not_theirs or reasons.operator_needed()
    if situation.not_theirs is not None and command.name in of_holder(mode):
        return situation.not_theirs
    if event is not None and not (event is Event.PAUSE and situation.homing):
        refused = modes.refusal(situation.state, event, now, situation.rights)
        if refused is not None:
            return refused
    if command.modes and mode not in command.modes:
        return reasons.wrong_mode(command.name, ", ".join(command.modes), mode)
    return next((why for each in command.conditions if (why := _missing(each, situation)) is not None), None)


def _missing(condition: Condition, situation: Situation) -> Reason | None:
    check = _CHECKS.get(condition)
    return situation.work[condition] if check is None else check(situation)


def hold_refusal(situation: Situation) -> Reason | None:
    """Reason why a hold would not move the robot by hand; None if it would."""
    mode = situation.state.mode
    if situation.not_theirs is not None and HOLD in of_holder(mode):
        return situation.not_theirs
    if mode == "TELEOP":
        return None
    if mode != "READY":
        return reasons.wrong_mode(HOLD, "READY", mode)
    why = situation.busy or safety.sensors(situation.health, situation.config)
    return why or safety.supervision(situation.health, situation.config, True)


def of_holder(mode: Mode) -> tuple[str, ...]:
    """What only the holder of control may do in a mode. Acknowledging a fault moves nothing."""
    return () if mode == "FAULT" else _OF_HOLDER


def allowed(now: float, situation: Situation) -> dict[str, Reason | None]:
    """Reason why each command, or a hold, would be refused now; None if it would be taken with valid arguments.

    Those of other processes are told where they depend on the mode. Commands about control are left out.
    """
    commands = {
        command.name: refusal(command, now, situation)
        for command in COMMANDS
        if (command.process == "controller" and command.tag != "control") or command.modes
    }
    return commands | {HOLD: hold_refusal(situation)}
