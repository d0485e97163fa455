"""Supervision: mode, latched stops, who holds control, and whether what comes in is fresh enough to go on moving."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from controller import modes, safety
from controller.authority import Authority, client_of
from controller.config import ControllerConfig
from controller.interface import Inputs
from controller.lease import Client, draw_nonce
from controller.lines import Lines
from controller.modes import Event
from controller.movement import Movement
from controller.permission import Situation
from controller.stop_latch import StopLatch
from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.control_messages import StopRecord

#: A bridge whose watchdog has held the robot for so long (s) is offered another token.
_ANEW_S: Final = 2.0


class Supervisor:
    """The machine of modes with everything that drives it. `take` the inputs of each period first, then `review`."""

    def __init__(self, config: ControllerConfig, movement: Movement, lines: Lines, starts: int) -> None:
        """Start in IDLE.

        Args:
            config: Section `[controller]`.
            movement: What is ended when a mode ends.
            lines: For people.
            starts: How often a controller of this robot has started, counted durably.
        """
        self._config, self._movement, self._lines = config, movement, lines
        self.stops = StopLatch()
        self.authority = Authority(draw_nonce, config.supervision_s, starts)
        self.state = modes.boot()
        self._inputs = Inputs()
        #: When the bridge last did as it was told, and how many commands it had refused by then.
        self._obeyed, self._refused = 0.0, 0
        self.health = safety.health(self._inputs, None, 0.0)

    @property
    def mode(self) -> m.Mode:
        """Mode of the machine."""
        return self.state.mode

    @property
    def bridge(self) -> m.BridgeState | None:
        """Newest word of the bridge."""
        return self._inputs.bridge.message if self._inputs.bridge is not None else None

    def restore(self, stops: Iterable[StopRecord]) -> None:
        """Take up the latched stops of an earlier start."""
        self.stops = StopLatch(tuple(stops))
        self.state = modes.boot(self.stops.latched)

    def take(self, inputs: Inputs, trouble: str, now: float) -> None:
        """Take in how fresh everything is.

        Args:
            inputs: Newest of everything.
            trouble: Why the ledger cannot be relied on; empty when it can.
            now: Monotonic time (s).
        """
        self._inputs = inputs
        if self.bridge is not None and self.authority.token is None:
            self.authority.begin(self.bridge.epoch)
            self._obeyed = now
        token, astray = self.authority.token, self._movement.body.following.astray
        self.health = safety.health(inputs, None if token is None else token.epoch, now, trouble, astray)

    def review(self, now: float) -> None:
        """End what must not go on, and begin what an operator's hand holds."""
        self._review_token(now)
        inputs, bridge = self._inputs, self.bridge
        latched = self.stops.take(inputs.stops, bridge, inputs.wall_time)
        if latched:
            self.event(Event.STOP, now, latched)
        elif self.stops.released(bridge):
            self.event(Event.RESET, now, self.stops.reset_reason, modes.OPERATOR)
        if lost := self.authority.review(inputs.presence, self._movement.at_rest, now):
            self._pause(lost, now)
        verdict = safety.check(self.mode, self._movement.homing, self.health, self._config)
        if verdict.action == "fault":
            self.event(Event.FAULT, now, verdict.reason)
        elif verdict.action == "protect":
            self.event(Event.PROTECT, now, verdict.reason)
        elif verdict.action == "pause":
            self._pause(verdict.reason, now)
        self._movement.sequence.wind_up(self.authority.unwatched(now))
        self.state = modes.observe(self.state, safety.cause(self.health, self._config), now)
        self._review_hold(now)

    def event(self, event: Event, now: float, reason: str, by: modes.Rights = modes.SYSTEM) -> str:
        """Put an event to the machine; what it changes is logged. Returns the refusal."""
        before = self.state
        transition = modes.step(before, event, now, reason, by)
        self.state = transition.state
        if self.mode != before.mode:
            self._movement.leave(before.mode)
            worse = modes.severity(self.mode) >= modes.severity("PAUSED")
            self._lines.say("warning" if worse else "info", f"{before.mode} → {self.mode}: {self.state.reason}")
        return transition.refused

    def remark(self, reason: str) -> None:
        """Why the robot is in its mode is another reason from now on."""
        self.state = replace(self.state, reason=reason)

    def busy(self) -> str:
        """What has to end before a motion may begin; empty when nothing."""
        return self._movement.busy(self.bridge)

    def situation(self, work: bool, approval: str, now: float, intent: intents.Intent | None = None) -> Situation:
        """What a permission depends on.

        Args:
            work: Whether a point is accepted.
            approval: Why work may not begin for want of an approved preview; empty when it may.
            now: Monotonic time (s).
            intent: What is asked; None for whoever may operate.
        """
        client, authority = Client("", "") if intent is None else client_of(intent), self.authority
        return Situation(
            rights=modes.OPERATOR if intent is None else authority.rights(client, intent.role),
            not_theirs="" if intent is None else authority.refusal(client, intent.role),
            unwatched=authority.unwatched(now),
            config=self._config,
            state=self.state,
            health=self.health,
            homing=self._movement.homing,
            busy=self.busy(),
            work=work,
            approval=approval,
        )

    def _review_token(self, now: float) -> None:
        """One command with a spoilt number far ahead, once accepted, would have all others refused for good."""
        health = self.health
        if health.watchdog and not health.overruled:
            if now - self._obeyed < _ANEW_S or not self._movement.at_rest:
                return
            if health.refused > self._refused:
                self.authority.begin_anew()
                self._lines.say("warning", f"the bridge refused every command for {_ANEW_S:.0f} s: a new token begins")
        self._obeyed, self._refused = now, health.refused

    def _pause(self, reason: str, now: float) -> None:
        """What moves comes to rest, and nothing resumes by itself."""
        if self.mode in modes.MOVING:
            self.event(Event.LOST, now, reason)
        elif self._movement.homing:
            self._movement.stay()
            self._lines.say("warning", f"bringing the arm home was stopped: {reason}")

    def _review_hold(self, now: float) -> None:
        hand = self._movement.teleoperation
        holding = hand.holding(self._inputs.teleop, now)
        client = hand.client
        not_theirs = self.authority.refusal(client, "operator") if holding else ""
        holding = holding and not (not_theirs and self.mode == "TELEOP")
        if self.mode == "TELEOP" and not holding:
            self.event(Event.RELEASE, now, "the hold was released")
        elif self.mode == "READY" and holding and hand.pressed:
            why = not_theirs or self.busy() or safety.sensors(self.health, self._config)
            why = why or safety.supervision(self.health, self._config, True)
            if why:
                hand.refuse()
                self._lines.say("warning", f"teleoperation refused: {why}")
            else:
                self.authority.claim(client, now)
                rights = self.authority.rights(client, "operator")
                self.event(Event.HOLD, now, f"{client.user} moves the robot", rights)
