"""Supervision of one robot: mode, latched stops, control authority and health of the inputs."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Final

from controller.config import SupervisionConfig
from controller.identity import Client
from controller.ledger.journal import EventLogger
from controller.supervision import health as safety
from controller.supervision import modes
from controller.supervision.authority import Authority, client_of
from controller.supervision.fencing import FencingToken, draw_nonce
from controller.supervision.latched_stops import LatchedStops
from controller.supervision.modes import Event
from controller.supervision.permission import Situation, hold_refusal
from controller.work.movement import Movement
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import Condition
from rolling_panda.messages.supervision import Presence, StopRecord, TeleopTarget
from rolling_panda.transport.inbox import Inbox

#: A new token is requested when the bridge's watchdog has held the robot for this long (s).
_ANEW_S: Final = 2.0
#: Longest time to brake to rest (s, the bridge's clock), and of one command with a corrupted number, which the
#: watchdog ends.
_BRAKING_S: Final = 0.4

#: What a pause interrupts, by its phase; a calibration is begun anew.
_INTERRUPTED: dict[m.Phase, m.Interrupted] = {"SURVEY": "survey", "CALIBRATION": ""}


class Supervisor:
    """The supervision state machine and its inputs. Call `update` with the inputs of each period, then `review`."""

    def __init__(
        self,
        config: SupervisionConfig,
        movement: Movement,
        event_log: EventLogger,
        draw: Callable[[], str] = draw_nonce,
    ) -> None:
        """Start in IDLE.

        Args:
            config: Section `[controller.supervision]`.
            movement: What is ended when a mode ends.
            event_log: Records events for people.
            draw: Draws the random parts of tokens and stops.
        """
        self._draw = draw
        self._config, self._movement, self._event_log = config, movement, event_log
        self.stops = LatchedStops()
        self.authority = Authority(config.supervision_s)
        self.fencing = FencingToken(draw)
        #: The stop to send to the bridge, until it shows that it has latched one.
        self.stop_due: m.StopRequest | None = None
        #: Stamp of the newest bridge state without motion by another sender's commands.
        self._explained = 0.0
        self.state = modes.boot()
        #: Activity that a pause or a protective stop interrupted, until the next start.
        self.interrupted: m.Interrupted = ""
        #: Why the robot stands in the midst of its work, to go on by itself; None where it does not.
        self.waits: m.Reason | None = None
        self._inbox = Inbox()
        #: Time of the last followed command, and the number of refused commands by then.
        self._obeyed, self._refused = 0.0, 0
        self.health = safety.health(self._inbox, False, 0.0)

    @property
    def mode(self) -> m.Mode:
        """Mode of the machine."""
        return self.state.mode

    @property
    def bridge(self) -> m.BridgeState | None:
        """Newest word of the bridge."""
        newest = self._inbox.newest(m.BridgeState)
        return None if newest is None else newest.message

    def restore(self, stops: Iterable[StopRecord]) -> None:
        """Take up the latched stops of an earlier start."""
        self.stops = LatchedStops(tuple(stops))
        self.state = modes.boot(self.stops.latched)

    def update(self, inbox: Inbox, trouble: m.Reason | None, now: float) -> None:
        """Take in how fresh everything is.

        Args:
            inbox: What has arrived.
            trouble: Why the ledger cannot be relied on; None when it can.
            now: Monotonic time (s).
        """
        self._inbox = inbox
        if (changed := self.fencing.update(self.bridge, now)) is not None:
            self._event_log.log(changed)
        body = self._movement.body
        self.health = safety.health(
            inbox,
            self.fencing.overruled,
            now,
            trouble,
            body.tracking_error.reason,
            reasons.touch_unfelt() if body.contact.lost else None,
            None if body.contact.touch is None else body.contact.touch.reason,
        )

    def review(self, stops: tuple[m.StopRequest, ...], now: float) -> None:
        """Latch new stops, end the motion that is no longer allowed, and start motion by hand."""
        self._review_token(now)
        bridge = self.bridge
        latched = self.stops.update((*stops, *self._review_motion()), bridge, self._inbox.wall_time)
        if latched is not None:
            self.event(Event.STOP, now, latched)
        elif self.stops.released(bridge):
            self.event(Event.RESET, now, self.stops.reset_reason, modes.OPERATOR)
        lost = self.authority.review(self._inbox.newest(Presence), self._movement.at_rest, now)
        if lost is not None:
            self._pause(lost, now)
        moving = self._movement.homing or self._movement.backing_off
        verdict = safety.check(self.mode, moving, self.health, self._config)
        waited, self.waits = self.waits, None
        match verdict:
            case safety.Verdict("fault", reason):
                self.event(Event.FAULT, now, reason)
            case safety.Verdict("protect", reason):
                # Where the robot goes back after a contact, another cause ends that.
                self._movement.stay()
                touched = reason is self.health.contact
                if touched and (told := self._movement.stopped_by_contact()) is not None:
                    self._event_log.log(told)
                self.event(Event.PROTECT, now, reason)
                if touched:
                    self._movement.back_off()
            case safety.Verdict("pause", reason):
                self._pause(reason, now)
            case safety.Verdict("wait", reason):
                self.waits = reason
                if waited is None:
                    self._event_log.log(reason)
        self._movement.sequence.finish_cut_and_pause(self.authority.unwatched(now))
        self.state = modes.observe(self.state, safety.cause(self.health, self._config), now)
        self._review_hold(now)

    def event(self, event: Event, now: float, reason: m.Reason, by: modes.Rights = modes.SYSTEM) -> m.Reason | None:
        """Process an event; a change of mode is logged. Returns the reason of a refusal; None without one."""
        before = self.state
        transition = modes.step(before, event, now, reason, by)
        self.state = transition.state
        if self.mode != before.mode:
            self._note_interruption(before.mode)
            self._movement.leave(before.mode)
            halted = modes.severity(self.mode) >= modes.severity("PAUSED")
            told = reasons.robot_halted if halted else reasons.mode_changed
            self._event_log.log(told(before.mode, self.mode, self.state.reason))
            if event is Event.ARM and self._movement.body.contact.force is None:
                self._event_log.log(reasons.touch_never_felt())
        return transition.refused

    def _note_interruption(self, before: m.Mode) -> None:
        if before in modes.MOVING and self.mode in ("PAUSED", "PROTECTIVE_STOP"):
            at_work = _INTERRUPTED.get(self._movement.sequence.phase, "work")
            self.interrupted = "teleoperation" if before == "TELEOP" else at_work
        elif before in modes.MOVING or self.mode not in ("READY", "PAUSED", "PROTECTIVE_STOP"):
            self.interrupted = ""

    def remark(self, reason: m.Reason) -> None:
        """Why the robot is in its mode is another reason from now on."""
        self.state = replace(self.state, reason=reason)

    def busy(self) -> m.Reason | None:
        """Action that has to end before a motion may begin; None without one."""
        return self._movement.busy(self.bridge)

    def situation(
        self, work: Mapping[Condition, m.Reason | None], now: float, intent: intents.Intent | None = None
    ) -> Situation:
        """State that a permission depends on.

        Args:
            work: Reason why each condition of the work does not hold; None if it does.
            now: Monotonic time (s).
            intent: The command; None for any operator.
        """
        client, authority = Client("", "") if intent is None else client_of(intent), self.authority
        return Situation(
            rights=modes.OPERATOR if intent is None else authority.rights(client, intent.role),
            not_theirs=None if intent is None else authority.refusal(client, intent.role),
            unwatched=authority.unwatched(now),
            config=self._config,
            state=self.state,
            health=self.health,
            homing=self._movement.homing,
            busy=self.busy(),
            work=work,
        )

    def _review_token(self, now: float) -> None:
        """One command with a spoilt number far ahead, once accepted, would have all others refused for good."""
        health = self.health
        if health.watchdog and self.fencing.token is not None:
            if now - self._obeyed < _ANEW_S or not self._movement.at_rest:
                return
            if health.refused > self._refused:
                self.fencing.release_token()
                self._event_log.log(reasons.commands_refused(_ANEW_S))
        self._obeyed, self._refused = now, health.refused

    def _review_motion(self) -> tuple[m.StopRequest, ...]:
        """Stop a robot that moves under this controller's token though not by its commands."""
        bridge = self.bridge
        if bridge is None or bridge.stop_id:
            self.stop_due = None
        if bridge is None or self.fencing.token is None or not self._movement.unknown_motion(bridge):
            self._explained = 0.0 if bridge is None else bridge.header.stamp
            return ()
        if bridge.header.stamp - self._explained <= _BRAKING_S:
            return ()
        reason = reasons.foreign_motion()
        stop = m.StopRequest(stop_id=f"motion-{self._draw()}", source="controller", user="", reason=reason)
        self.stop_due = stop
        # The other sender knows this token.
        self.fencing.release_token()
        return (stop,)

    def _pause(self, reason: m.Reason, now: float) -> None:
        """Bring all motion to rest. Nothing resumes by itself."""
        if self.mode in modes.MOVING:
            self.event(Event.LOST, now, reason)
        elif self._movement.homing:
            self._movement.stay()
            self._event_log.log(reasons.homing_stopped(reason))

    def _review_hold(self, now: float) -> None:
        hand = self._movement.teleoperation
        holding = hand.holding(self._inbox.newest(TeleopTarget), now)
        client = hand.client
        not_theirs = self.authority.refusal(client, "operator") if holding else None
        holding = holding and (not_theirs is None or self.mode != "TELEOP")
        if self.mode == "TELEOP" and not holding:
            self.event(Event.RELEASE, now, reasons.hold_ended())
        elif self.mode == "READY" and holding and hand.pressed:
            why = hold_refusal(replace(self.situation({}, now), not_theirs=not_theirs))
            if why is not None:
                hand.refuse()
                self._event_log.log(reasons.teleoperation_refused(why))
            else:
                self.authority.claim(client, now)
                rights = self.authority.rights(client, "operator")
                self.event(Event.HOLD, now, reasons.moved_by_hand(client.user), rights)
