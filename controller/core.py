"""The controller without wires: newest inputs and intents in, commands and state out. No clock, no thread."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from controller import modes, safety
from controller.authority import ABOUT_CONTROL, MOTION, Authority, client_of
from controller.body import Body
from controller.config import ControllerConfig
from controller.cut_clearance import CutClearance
from controller.cut_sequence import CutSequence
from controller.homing import Homing
from controller.interface import Inputs, Outputs
from controller.journal import Journal, RequestRow, TicketRow
from controller.lease import Client, draw_nonce
from controller.modes import Event
from controller.motion import Measured, Tracking
from controller.operator import Operator
from controller.permission import EVENTS, Situation, allowed, refusal
from controller.queue import PointQueue
from controller.reach import PostureSearch
from controller.report import controller_state
from controller.session import Session
from controller.setpoints import BRAKED
from controller.stop_latch import StopLatch
from controller.teleoperation import Teleoperation
from controller.whole_body.task import Method
from controller.work_plan import PlanRequest
from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.control_messages import StopRecord
from rolling_panda.differential_drive import Array
from rolling_panda.errors import ControlError
from rolling_panda.look_messages import PictureRequest
from rolling_panda.robot_model import RobotModel

_STATE_S, _STOPS_S = 0.05, 0.5


class Controller:
    """Supervision, queue and whole-body control of one robot.

    `step` it at the configured rate; `answer` operators between steps, on the same thread.
    """

    def __init__(
        self,
        config: ControllerConfig,
        robot_config: RobotConfig,
        run_id: str = "cut",
        method: Method | None = None,
        starts: int = 0,
    ) -> None:
        """Build the robot's model and start in IDLE.

        Args:
            config: Section `[controller]`.
            robot_config: Section `[robot]`.
            run_id: Makes this start's cut ids unlike any other's; letters, digits, `_.:-`.
            method: Whole-body method in place of the configured one.
            starts: How often a controller of this robot has started, counted durably.

        Raises:
            ConfigError: There is no such method.
            ModelError: A robot description is missing.
        """
        self._config, self._body = config, Body(config, robot_config, method)
        self._robot, self._dt, self._follower = self._body.robot, self._body.dt, self._body.follower
        self._saturation, self._setpoints = self._body.saturation, self._body.setpoints
        self._journal = Journal()
        self._queue = PointQueue(config, self._journal)
        self._clearance = CutClearance(RobotModel(robot_config), config)
        search = PostureSearch(RobotModel(robot_config), config, self._clearance.admits)
        self._session = Session(self._queue)
        known = self._session.known
        self._sequence = CutSequence(config, search, self._follower, self._saturation, self._queue, run_id, known)
        self._teleoperation = Teleoperation(config, self._follower, self._robot.drive)
        self._stops = StopLatch()
        self._authority = Authority(draw_nonce, config.supervision_s, starts)
        self._operator = Operator(self._queue)
        self._homing: Homing | None = None
        self._state = modes.boot()
        self._inputs = Inputs()
        self._health = safety.health(self._inputs, None, 0.0)
        self._tracking: Tracking | None = None
        self._points_seen: object = None
        self._now = 0.0
        self._state_due = self._stops_due = -math.inf
        self._events: list[m.LogEvent] = []

    @property
    def mode(self) -> m.Mode:
        """Mode of the supervision machine."""
        return self._state.mode

    @property
    def recorded(self) -> int:
        """Number of the newest record: what was done is durable when the ledger has that one."""
        return self._journal.number

    def restore(self, rows: Iterable[TicketRow], stops: tuple[StopRecord, ...] = ()) -> None:
        """Take up the queue and the latched stops of an earlier start; nothing resumes by itself."""
        self._queue.restore(rows)
        self._stops = StopLatch(stops)
        self._state = modes.boot(self._stops.latched)

    @property
    def tracking(self) -> Tracking | None:
        """Of the motion that the last step followed; None while nothing was followed."""
        return self._tracking

    def step(self, inputs: Inputs, now: float) -> Outputs:
        """One control period.

        Args:
            inputs: Newest of everything.
            now: Monotonic time (s), the clock of the inputs' arrival times.
        """
        self._now = now
        self._take(inputs, now)
        self._supervise(now)
        try:
            xi, cut = self._move(now)
        except ControlError as error:
            self._event(Event.FAULT, now, str(error))
            xi, cut = self._saturation.ramp(self._setpoints.sent), None
        motion = self._send(xi)
        release = self._stops.release_due()
        state = control = stops = plan = request = None
        if now >= self._state_due:
            self._state_due = now + _STATE_S
            request = self._review(now)
            plan, state, control = self._session.message(now), self._report(now), self._authority.message(now)
        if self._stops.changed or now >= self._stops_due:
            self._stops_due, stops = now + _STOPS_S, self._stops.message()
        events, self._events = tuple(self._events), []
        picture, records = self._picture(now), self._journal.take()
        return Outputs(motion, cut, release, state, events, plan, request, records, picture, control, stops)

    def answer(self, intent: intents.Intent, now: float) -> m.Answer:
        """Do what an operator asks, or say why not.

        Args:
            intent: What is asked.
            now: Monotonic time (s).
        """
        self._now = now
        if isinstance(intent, ABOUT_CONTROL):
            refused = self._authority.ask(intent, now)
        else:
            refused = refusal(intent, now, self._situation(intent)) or self._do(intent, now)
        what = type(intent).__name__
        if isinstance(intent, intents.AnyIntent):
            row = RequestRow(asked=intent, ok=not refused, reason=refused[:500], mode=self._state.mode)
            self._journal.add("request", intent.user, row)
        if refused:
            self._say("warning", f"{intent.user}: {what} refused: {refused}")
            return m.Answer(ok=False, reason=refused[:500])
        if told := self._operator.told(intent):
            self._say("info", f"{intent.user}: {told}")
        return m.Answer(ok=True)

    # --- inputs and supervision --------------------------------------------------------------------------------------

    def _take(self, inputs: Inputs, now: float) -> None:
        self._inputs = inputs
        bridge = inputs.bridge.message if inputs.bridge is not None else None
        if bridge is not None and self._authority.token is None:
            self._authority.begin(bridge.epoch)
        self._journal.observe(inputs.ledger, now)
        self._journal.stops(inputs.stops)
        trouble = self._journal.trouble(now, self._config.ledger_max_age_s)
        self._body.take(inputs)
        token, astray = self._authority.token, self._body.following.astray
        self._health = safety.health(inputs, None if token is None else token.epoch, now, trouble, astray)
        self._body.surroundings.work_at(self._sequence.places)
        self._clearance.take(inputs.obstacles)
        if bridge is not None:
            for text in self._sequence.watch(bridge, None if inputs.look is None else inputs.look.message, now):
                self._say("info", text)
        if inputs.points is not None and inputs.points is not self._points_seen:
            self._points_seen = inputs.points
            for text in self._queue.update(inputs.points.message, self._sequence.in_canes):
                self._say("warning", text)

    def _supervise(self, now: float) -> None:
        bridge = self._inputs.bridge.message if self._inputs.bridge is not None else None
        latched = self._stops.take(self._inputs.stops, bridge, self._inputs.wall_time)
        if latched:
            self._event(Event.STOP, now, latched)
        elif self._stops.released(bridge):
            self._event(Event.RESET, now, self._stops.reset_reason, modes.OPERATOR)
        if lost := self._authority.review(self._inputs.presence, self._setpoints.at_rest, now):
            self._pause(lost, now)
        verdict = safety.check(self._state.mode, self._homing is not None, self._health, self._config)
        if verdict.action == "fault":
            self._event(Event.FAULT, now, verdict.reason)
        elif verdict.action == "protect":
            self._event(Event.PROTECT, now, verdict.reason)
        elif verdict.action == "pause":
            self._pause(verdict.reason, now)
        self._sequence.wind_up(self._authority.unwatched(now))
        self._state = modes.observe(self._state, safety.cause(self._health, self._config), now)
        self._supervise_hold(now)

    def _pause(self, reason: str, now: float) -> None:
        """What moves comes to rest, and nothing resumes by itself."""
        if self._state.mode in modes.MOVING:
            self._event(Event.LOST, now, reason)
        elif self._homing is not None:
            self._homing = None
            self._say("warning", f"bringing the arm home was stopped: {reason}")

    def _supervise_hold(self, now: float) -> None:
        holding = self._teleoperation.holding(self._inputs.teleop, now)
        client = self._teleoperation.client
        not_theirs = self._authority.refusal(client, "operator") if holding else ""
        holding = holding and not (not_theirs and self._state.mode == "TELEOP")
        if self._state.mode == "TELEOP" and not holding:
            self._event(Event.RELEASE, now, "the hold was released")
        elif self._state.mode == "READY" and holding and self._teleoperation.pressed:
            why = not_theirs or self._busy() or safety.sensors(self._health, self._config)
            why = why or safety.supervision(self._health, self._config, True)
            if why:
                self._teleoperation.refuse()
                self._say("warning", f"teleoperation refused: {why}")
            else:
                self._authority.claim(client, now)
                rights = self._authority.rights(client, "operator")
                self._event(Event.HOLD, now, f"{client.user} moves the robot", rights)

    def _busy(self) -> str:
        """What has to end before a motion may begin; empty when nothing."""
        if self._homing is not None:
            return "the arm is being brought home; wait until it is there"
        bridge = self._inputs.bridge
        if self._sequence.cutting or (bridge is not None and bridge.message.cutter == "closing"):
            return "the blades are closing; wait until the cut has ended"
        return ""

    def _event(self, event: Event, now: float, reason: str, by: modes.Rights = modes.SYSTEM) -> str:
        """Put an event to the machine; what it changes is logged. Returns the refusal."""
        before = self._state
        transition = modes.step(before, event, now, reason, by)
        self._state = transition.state
        if self._state.mode != before.mode:
            self._leave(before.mode)
            worse = modes.severity(self._state.mode) >= modes.severity("PAUSED")
            self._say("warning" if worse else "info", f"{before.mode} → {self._state.mode}: {self._state.reason}")
        return transition.refused

    def _leave(self, mode: m.Mode) -> None:
        self._homing = None
        if mode == "AUTO":
            self._sequence.abort()
        self._teleoperation.refuse()

    # --- motion ------------------------------------------------------------------------------------------------------

    def _move(self, now: float) -> tuple[Array, m.CutCommand | None]:
        """ξ̇ (9) for this period, and the cut to command."""
        self._tracking = None
        robot, mode = self._body.measured, self._state.mode
        if robot is None or not self._authority.held or mode not in ("READY", "TELEOP", "AUTO"):
            return self._saturation.ramp(self._setpoints.sent), None
        if mode == "TELEOP":
            self._tracking = self._teleoperation.step(robot)
            return self._tracking.xi, None
        if mode == "READY":
            return self._ready(robot), None
        work = self._sequence.step(robot, now)
        self._tracking = work.tracking
        for text in work.events:
            self._say("warning", text)
        if work.pause:
            self._event(Event.LOST, now, work.pause)
        elif work.finished:
            self._event(Event.FINISHED, now, work.summary)
        return work.xi, self._cut(*work.cut) if work.cut is not None and self._state.mode == "AUTO" else None

    def _cut(self, cut_id: str, point_id: str) -> m.CutCommand | None:
        token, joints = self._authority.token, self._inputs.joints
        if token is None or joints is None:
            return None
        return m.CutCommand(
            epoch=token.epoch, token=token.nonce, echo=joints.message.sequence, cut_id=cut_id, point_id=point_id
        )

    def _ready(self, robot: Measured) -> Array:
        if self._homing is None:
            return self._saturation.ramp(self._setpoints.sent)
        xi = self._homing.step(robot)
        if self._homing.blocked:
            self._say("warning", f"bringing the arm home was stopped: {self._homing.blocked}")
            self._homing = None
        elif self._homing.done:
            self._homing = None
            self._state = replace(self._state, reason="the arm is home")
            self._say("info", "the arm is home")
        return xi

    def _picture(self, now: float) -> PictureRequest | None:
        token = self._authority.token
        due = None if token is None else self._sequence.picture(now)
        if token is None or due is None:
            return None
        return PictureRequest(epoch=token.epoch, number=due[0], point_id=due[1])

    def _send(self, xi: Array) -> m.MotionCommand | None:
        """Nothing leaves without a token; what is not finite or outside the limits is not sent, the robot brakes."""
        if not self._setpoints.admits(xi):
            self._say("error", BRAKED)
        xi = self._setpoints.smooth(xi)
        joints, token = self._inputs.joints, self._authority.token
        latched_and_still = self._state.mode == "ESTOP_LATCHED" and not np.any(xi)
        if token is None or joints is None or latched_and_still or self._health.overruled:
            self._setpoints.withhold()
            return None
        return self._setpoints.command(xi, token, joints.message.sequence)

    # --- operator ----------------------------------------------------------------------------------------------------

    def _situation(self, intent: intents.Intent | None = None) -> Situation:
        client, authority = Client("", "") if intent is None else client_of(intent), self._authority
        return Situation(
            rights=modes.OPERATOR if intent is None else authority.rights(client, intent.role),
            not_theirs="" if intent is None else authority.refusal(client, intent.role),
            unwatched=authority.unwatched(self._now),
            config=self._config,
            state=self._state,
            health=self._health,
            homing=self._homing is not None,
            busy=self._busy(),
            work=self._queue.next() is not None,
        )

    def _do(self, intent: intents.Intent, now: float) -> str:
        """Do what was not refused; returns what the content itself is refused for."""
        if isinstance(intent, intents.Reset):
            bridge = self._inputs.bridge
            return self._stops.ask_release(intent, bridge.message if bridge is not None else None, now)
        if isinstance(intent, intents.Pause) and self._homing is not None:
            self._homing = None
            self._state = replace(self._state, reason=f"bringing the arm home was stopped by {intent.user}")
            self._say("info", self._state.reason)
            return ""
        client, event = client_of(intent), EVENTS.get(type(intent))
        if isinstance(intent, MOTION):
            self._authority.claim(client, now)
        if event is not None:
            rights = self._authority.rights(client, intent.role)
            refused = self._event(event, now, f"{type(intent).__name__.lower()} by {intent.user}", rights)
            if isinstance(intent, intents.Start) and not refused:
                self._sequence.begin(intent.distance if isinstance(intent, intents.Survey) else 0.0)
            return refused
        if isinstance(intent, intents.Home):
            self._homing = Homing(self._config, self._follower, self._dt)
            self._state = replace(self._state, reason="the arm is being brought home")
            return ""
        return self._operator.points(intent)

    def _review(self, now: float) -> PlanRequest | None:
        """Look after the session's plan."""
        obstacles = self._inputs.obstacles
        return self._session.review(
            made=self._inputs.plan,
            q=None if self._body.measured is None else self._sequence.clear_of_canes(self._body.measured.q),
            obstacles=() if obstacles is None else obstacles.message.capsules,
            at_rest=self._homing is None and self._state.mode != "TELEOP" and self._setpoints.at_rest,
            working=self._state.mode == "AUTO",
            now=now,
        )

    # --- report ------------------------------------------------------------------------------------------------------

    def _report(self, now: float) -> m.ControllerState:
        return controller_state(
            config=self._config,
            robot=self._robot,
            state=self._state,
            phase=self._sequence.phase,
            active=self._sequence.active,
            measured=self._body.measured,
            tracking=self._tracking,
            allowed=allowed(now, self._situation()),
            inputs=self._inputs,
            queue=self._queue.entries(),
            now=now,
        )

    def _say(self, severity: m.Severity, text: str) -> None:
        event = m.LogEvent(header=m.Header(self._now), process="controller", severity=severity, text=text[:500])
        self._events.append(event)
        self._journal.add("event", "controller", event)
