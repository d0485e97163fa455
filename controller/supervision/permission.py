"""Permission of each intent in the present state, with the reason of a refusal."""

from dataclasses import dataclass

from controller.config import ControllerConfig
from controller.supervision import health as safety
from controller.supervision import modes
from controller.supervision.modes import Event
from rolling_panda.messages import commands as intents

#: What an intent is to the machine of modes.
EVENTS: dict[type[intents.Intent], Event] = {
    intents.Arm: Event.ARM,
    intents.Start: Event.START,
    intents.Survey: Event.START,
    intents.Pause: Event.PAUSE,
    intents.Resume: Event.RESUME,
    intents.Acknowledge: Event.ACKNOWLEDGE,
    intents.Reset: Event.RESET,
}
#: One intent of each type, to ask whether it would be taken; None where only its content can be refused.
_PROBES: dict[type[intents.Intent], intents.Intent | None] = {
    intents.Arm: intents.Arm(user=""),
    intents.AcceptPoint: None,
    intents.RejectPoint: None,
    intents.ReconsiderPoint: None,
    intents.RestoreAccepted: None,
    intents.ResolvePoint: None,
    intents.AcceptAll: None,
    intents.MoveInQueue: None,
    intents.ResetOrder: None,
    intents.SetApproach: None,
    intents.RequestPreview: None,
    intents.ApprovePreview: None,
    intents.RequirePreview: None,
    intents.Start: intents.Start(user=""),
    intents.Survey: intents.Survey(user=""),
    intents.Pause: intents.Pause(user=""),
    intents.Resume: intents.Resume(user=""),
    intents.Home: intents.Home(user=""),
    intents.Acknowledge: intents.Acknowledge(user=""),
    intents.Reset: intents.Reset(user="", reason="-"),
}


@dataclass(frozen=True)
class Situation:
    """State that a permission depends on.

    Attributes:
        config: Of the controller.
        state: Of the machine of modes.
        health: Freshness of the inputs.
        homing: True while the arm is brought home.
        busy: Action that blocks a new motion; empty when none.
        waits: Reason why no accepted point is workable; empty when one is.
        rights: Rights of the client.
        not_theirs: Reason why the client may not move the robot; empty when it may.
        approval: Reason why a start needs an approved preview first; empty when it does not.
        unwatched: Reason why automatic work lacks an attentive operator; empty when it has one.
    """

    config: ControllerConfig
    state: modes.State
    health: safety.Health
    homing: bool
    busy: str
    waits: str
    rights: modes.Rights = modes.ANYBODY
    not_theirs: str = ""
    unwatched: str = ""
    approval: str = ""


def refusal(intent: intents.Intent, now: float, situation: Situation) -> str:
    """Why an intent would not be taken now, apart from its own content; empty when it would.

    Args:
        intent: What is asked.
        now: Monotonic time (s).
        situation: Of the robot.
    """
    config, health, mode = situation.config, situation.health, situation.state.mode
    if "operator" not in situation.rights:
        return situation.not_theirs or "only who may operate may ask for this"
    if isinstance(intent, intents.OF_HOLDER) and mode != "FAULT" and situation.not_theirs:
        return situation.not_theirs
    event = EVENTS.get(type(intent))
    if event is not None and not (event is Event.PAUSE and situation.homing):
        refused = modes.step(situation.state, event, now, by=situation.rights).refused
        if refused:
            return refused
    if isinstance(intent, intents.Arm | intents.Start | intents.Home):
        why = safety.sensors(health, config)
        if why:
            return why
        if health.watchdog:
            return "the bridge's watchdog holds the robot: wait until it takes commands"
    if isinstance(intent, intents.Start | intents.Home):
        why = safety.supervision(health, config, False) or situation.busy
        if why:
            return why
    if isinstance(intent, intents.Start):
        if situation.waits and not isinstance(intent, intents.Survey):
            return situation.waits
        if situation.approval and not isinstance(intent, intents.Survey):
            return situation.approval
        return safety.perception(health, config) or situation.unwatched
    if isinstance(intent, intents.Home) and mode != "READY":
        return f"the arm is brought home in READY; the mode is {mode}"
    return ""


def allowed(now: float, situation: Situation) -> tuple[str, ...]:
    """Types of the intents that would be taken now."""
    return tuple(
        kind.__name__ for kind, probe in _PROBES.items() if probe is None or not refusal(probe, now, situation)
    )
