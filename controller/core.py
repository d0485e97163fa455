"""The controller without wires: newest inputs and intents in, commands and state out. No clock, no thread."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from controller import modes, safety
from controller.config import ControllerConfig
from controller.cut_clearance import CutClearance
from controller.cut_sequence import CutSequence
from controller.estimate import BaseEstimate, wheels_ahead
from controller.homing import Homing
from controller.interface import Inputs, Outputs
from controller.journal import Journal, RequestRow, TicketRow
from controller.modes import Event
from controller.motion import Follower, Measured, Tracking
from controller.operator import Operator
from controller.permission import EVENTS, Situation, allowed, refusal
from controller.queue import PointQueue
from controller.reach import PostureSearch
from controller.report import controller_state
from controller.session import Session
from controller.stop_latch import StopLatch
from controller.surroundings import Surroundings
from controller.teleoperation import Teleoperation
from controller.whole_body.collision import CollisionModel
from controller.whole_body.registry import make_method
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Method
from controller.whole_body.two_rates import TwoRates
from controller.work_plan import PlanRequest
from rolling_panda import intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.differential_drive import NXI, Array
from rolling_panda.errors import ControlError
from rolling_panda.look_messages import PictureRequest
from rolling_panda.robot_model import RobotModel

_STATE_S = 0.05


class Controller:
    """Supervision, queue and whole-body control of one robot.

    `step` it at the configured rate; `answer` operators between steps, on the same thread.
    """

    def __init__(
        self, config: ControllerConfig, robot_config: RobotConfig, run_id: str = "cut", method: Method | None = None
    ) -> None:
        """Build the robot's model and start in IDLE.

        Args:
            config: Section `[controller]`.
            robot_config: Section `[robot]`.
            run_id: Makes this start's cut ids unlike any other's; letters, digits, `_.:-`.
            method: Whole-body method in place of the configured one.

        Raises:
            ConfigError: There is no such method.
            ModelError: A robot description is missing.
        """
        self._config, self._dt = config, 1.0 / config.rate_hz
        self._robot = RobotModel(robot_config)
        base_dt = self._dt * config.base_every
        self._saturation = Saturation(self._robot, config, self._dt, base_dt)
        self._base = BaseEstimate(self._robot.drive)
        self._surroundings = Surroundings(CollisionModel(self._robot))
        arm = method or make_method(self._robot, config, self._dt, self._surroundings.model)
        base = method or make_method(self._robot, config, base_dt, self._surroundings.model)
        self._method = TwoRates(arm, base, config.base_every)
        self._follower = Follower(config, self._method, self._dt)
        self._journal = Journal()
        self._queue = PointQueue(config, self._journal)
        self._clearance = CutClearance(RobotModel(robot_config), config)
        search = PostureSearch(RobotModel(robot_config), config, self._clearance.admits)
        self._session = Session(self._queue)
        known = self._session.known
        self._sequence = CutSequence(config, search, self._follower, self._saturation, self._queue, run_id, known)
        self._teleoperation = Teleoperation(config, self._follower, self._robot.drive)
        self._stops = StopLatch()
        self._operator = Operator(self._queue)
        self._homing: Homing | None = None
        self._state = modes.boot()
        self._inputs = Inputs()
        self._health = safety.health(self._inputs, None, 0.0)
        self._measured: Measured | None = None
        self._tracking: Tracking | None = None
        self._sent: Array = np.zeros(NXI)
        self._before: Array = self._sent
        self._epoch: int | None = None
        self._sequence_number = 0
        self._points_seen: object = None
        self._now = 0.0
        self._state_due = -math.inf
        self._events: list[m.LogEvent] = []

    @property
    def mode(self) -> m.Mode:
        """Mode of the supervision machine."""
        return self._state.mode

    @property
    def recorded(self) -> int:
        """Number of the newest record: what was done is durable when the ledger has that one."""
        return self._journal.number

    def restore(self, rows: Iterable[TicketRow]) -> None:
        """Take up the queue of an earlier start; nothing of it resumes by itself."""
        self._queue.restore(rows)

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
            xi, cut = self._saturation.ramp(self._sent), None
        xi = self._checked(xi)
        motion = self._motion(xi)
        release = self._stops.release_due()
        state = plan = request = None
        if now >= self._state_due:
            self._state_due = now + _STATE_S
            request = self._review(now)
            plan, state = self._session.message(now), self._report(now)
        events, self._events = tuple(self._events), []
        return Outputs(motion, cut, release, state, events, plan, request, self._journal.take(), self._picture(now))

    def answer(self, intent: intents.Intent, now: float) -> m.Answer:
        """Do what an operator asks, or say why not.

        Args:
            intent: What is asked.
            now: Monotonic time (s).
        """
        self._now = now
        refused = refusal(intent, now, self._situation())
        if not refused:
            refused = self._do(intent, now)
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
        if bridge is not None and self._epoch is None:
            self._epoch = bridge.epoch + 1
        self._journal.observe(inputs.ledger, now)
        self._journal.stops(inputs.stops)
        trouble = self._journal.trouble(now, self._config.ledger_max_age_s)
        self._health = safety.health(inputs, self._epoch, now, trouble)
        if inputs.joints is not None and inputs.odometry is not None:
            q = self._base.configuration(inputs.joints.message, inputs.odometry.message)
            # What the arm is told now it does after its own lag; that is when it has to fit the base's velocity.
            ahead = self._config.arm_lag_s + 0.5 * self._dt
            measured = np.array(inputs.joints.message.velocity[:2])
            wheels = wheels_ahead(measured, self._sent[:2], ahead, self._config.base_lag_s)
            self._measured = Measured(q, self._robot.kinematics(q), self._sent)
            self._method.begin(self._sent, self._before, wheels)
        self._surroundings.take(inputs.obstacles)
        self._surroundings.work_at(self._sequence.places)
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
        latched = self._stops.take(self._inputs.stops, bridge)
        if latched:
            self._event(Event.STOP, now, latched)
        elif self._stops.released(bridge):
            self._event(Event.RESET, now, self._stops.reset_reason, modes.OPERATOR)
        verdict = safety.check(self._state.mode, self._homing is not None, self._health, self._config)
        if verdict.action == "fault":
            self._event(Event.FAULT, now, verdict.reason)
        elif verdict.action == "protect":
            self._event(Event.PROTECT, now, verdict.reason)
        elif verdict.action == "pause":
            self._homing = None
            if self._state.mode in modes.MOVING:
                self._event(Event.LOST, now, verdict.reason)
            else:
                self._say("warning", f"bringing the arm home was stopped: {verdict.reason}")
        self._state = modes.observe(self._state, self._cause(), now)
        self._supervise_hold(now)

    def _supervise_hold(self, now: float) -> None:
        holding = self._teleoperation.holding(self._inputs.teleop, now)
        if self._state.mode == "TELEOP" and not holding:
            self._event(Event.RELEASE, now, "the hold was released")
        elif self._state.mode == "READY" and holding and self._teleoperation.pressed:
            why = self._busy() or safety.sensors(self._health, self._config)
            why = why or safety.supervision(self._health, self._config, True)
            if why:
                self._teleoperation.refuse()
                self._say("warning", f"teleoperation refused: {why}")
            else:
                self._event(Event.HOLD, now, f"{self._teleoperation.user} moves the robot", modes.OPERATOR)

    def _busy(self) -> str:
        """What has to end before a motion may begin; empty when nothing."""
        if self._homing is not None:
            return "the arm is being brought home; wait until it is there"
        bridge = self._inputs.bridge
        if self._sequence.cutting or (bridge is not None and bridge.message.cutter == "closing"):
            return "the blades are closing; wait until the cut has ended"
        return ""

    def _cause(self) -> str:
        """Why a PROTECTIVE_STOP or FAULT could not be left now; empty when its cause is gone."""
        if self._health.overruled:
            return "another controller commands this robot"
        return (
            self._health.ledger
            or safety.sensors(self._health, self._config)
            or ("watchdog" if self._health.watchdog else "")
        )

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
        robot, mode = self._measured, self._state.mode
        if robot is None or mode not in ("READY", "TELEOP", "AUTO"):
            return self._saturation.ramp(self._sent), None
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
            self._event(Event.FINISHED, now, "no accepted point is left")
        cut = None
        if work.cut is not None and self._epoch is not None and self._state.mode == "AUTO":
            cut = m.CutCommand(epoch=self._epoch, cut_id=work.cut[0], point_id=work.cut[1])
        return work.xi, cut

    def _ready(self, robot: Measured) -> Array:
        if self._homing is None:
            return self._saturation.ramp(self._sent)
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
        due = self._sequence.picture(now) if self._epoch is not None else None
        return None if due is None else PictureRequest(epoch=self._epoch or 0, number=due[0], point_id=due[1])

    def _checked(self, xi: Array) -> Array:
        """The last gate: what is not finite or outside the limits is not sent; the robot brakes instead."""
        if not self._saturation.admits(xi, self._sent):
            self._say("error", "a velocity outside the limits was not sent; the robot brakes")
            xi = self._saturation.brake(self._sent)
        return self._saturation.smooth(xi, self._sent, self._before)

    def _motion(self, xi: Array) -> m.MotionCommand | None:
        joints = self._inputs.joints
        latched_and_still = self._state.mode == "ESTOP_LATCHED" and not np.any(xi)
        if self._epoch is None or joints is None or latched_and_still or self._health.overruled:
            self._sent = self._before = np.zeros(NXI)
            return None
        self._sent, self._before = xi, self._sent
        self._sequence_number += 1
        a, b, c, d, e, f, g, h, i = xi.tolist()
        return m.MotionCommand(
            epoch=self._epoch,
            sequence=self._sequence_number,
            echo=joints.message.sequence,
            xi=(a, b, c, d, e, f, g, h, i),
        )

    # --- operator ----------------------------------------------------------------------------------------------------

    def _situation(self) -> Situation:
        return Situation(
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
        event = EVENTS.get(type(intent))
        if event is not None:
            refused = self._event(event, now, f"{event.value} by {intent.user}", modes.OPERATOR)
            if isinstance(intent, intents.Start) and not refused:
                self._sequence.begin()
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
            q=None if self._measured is None else self._sequence.clear_of_canes(self._measured.q),
            obstacles=() if obstacles is None else obstacles.message.capsules,
            at_rest=self._homing is None and self._state.mode != "TELEOP" and not np.any(self._sent),
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
            measured=self._measured,
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
