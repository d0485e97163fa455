"""Core of the controller: what has arrived and intents in, messages out. No clock, no thread, no wire.

Supervision (`controller/supervision/supervisor.py`) decides whether the robot may move, `controller/work/movement.py`
how it moves, the queue what is cut. `Controller` calls them in order for each period and each request.
"""

import functools
import math
from collections.abc import Callable, Iterable
from typing import Literal

import msgspec

from controller.config import ControllerConfig
from controller.ledger.journal import (
    ApproachRow,
    EventLogger,
    Journal,
    LedgerState,
    OrderRow,
    PostureRow,
    PreviewRequiredRow,
    Records,
    RequestRow,
    TicketRow,
)
from controller.motion.contact import ContactMonitor
from controller.motion.follower import Tracking
from controller.planning.plan_manager import PlanManager
from controller.planning.preview import PreviewManager
from controller.planning.preview_plan import Preview, PreviewRequest
from controller.planning.work_plan import PlanRequest, WorkPlan
from controller.report import controller_state
from controller.supervision.authority import client_of
from controller.supervision.fencing import draw_nonce
from controller.supervision.modes import Event
from controller.supervision.permission import Situation, allowed, refusal
from controller.supervision.supervisor import Supervisor
from controller.whole_body.task import Method
from controller.work.movement import MotionResult, Movement
from controller.work.point_queue import PointQueue, QueueRequests, Ticket
from controller.work.posture_search import Found
from controller.work.postures import Postures
from controller.work.survey import open_place
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.bounds import wider
from rolling_panda.commands import COMMAND_OF, Condition, Handlers
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ControlError
from rolling_panda.messages.perception import (
    ARM,
    CALIBRATION,
    CHECK,
    CloseUpRequest,
    CloseUpResult,
    CutSight,
    Obstacles,
    RobotCalibration,
)
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.transport.inbox import Answered, Inbox, Rejected, Reply, Request

_STATE_S = 0.05
#: Refused messages that are reported, each period at most.
_REPORTED = 20


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
        draw: Callable[[], str] = draw_nonce,
    ) -> None:
        """Build the robot's model and start in IDLE.

        Args:
            config: Section `[controller]`.
            robot_config: Section `[robot]`.
            run_id: Prefix that makes the cut ids of this start unique; letters, digits, `_.:-`.
            method: Whole-body method in place of the configured one.
            draw: Draws the random parts of tokens and stops.

        Raises:
            ConfigError: There is no such method.
            ModelError: A robot description is missing.
        """
        self._config = config
        self._journal = Journal()
        self._event_log = EventLogger(self._journal)
        self._queue = PointQueue(config.work, self._journal)
        self._plans = PlanManager(self._queue)
        self._previews = PreviewManager(self._queue, self._journal, config.whole_body.hierarchy)
        permit = self._previews.permit
        self._movement = Movement(
            config,
            robot_config,
            self._queue,
            self._event_log,
            run_id,
            self._known,
            method,
            permit,
            self._plans.made_from,
            lambda: self._previews.binds,
        )
        self._postures = Postures(config.work, self._movement.body, self._movement.posture_check, self._journal)
        self._supervisor = Supervisor(config.supervision, self._movement, self._event_log, draw)
        self._handlers = self._all_handlers()
        self._inbox = Inbox()
        self._points_seen: object = None
        self._state_due = -math.inf
        self._calibration_due: m.UseCalibration | None = None
        self._relaxed_limits = (*wider("controller", config), *wider("robot", robot_config))
        for relaxed in self._relaxed_limits:
            self._event_log.log(reasons.limits_relaxed(relaxed))

    @property
    def mode(self) -> m.Mode:
        """Mode of the supervision machine."""
        return self._supervisor.mode

    @property
    def waits(self) -> bool:
        """Whether another controller commands the robot. This one publishes nothing and refuses intents."""
        return self._supervisor.fencing.waits

    @property
    def recorded(self) -> int:
        """Number of the newest record. Everything up to now is durable once the ledger has it."""
        return self._journal.number

    @property
    def tracking(self) -> Tracking | None:
        """Tracking of the last step's motion; None without a motion."""
        return self._movement.tracking

    @property
    def contact(self) -> ContactMonitor:
        """What the arm feels."""
        return self._movement.body.contact

    def restore(
        self,
        rows: Iterable[TicketRow],
        stops: tuple[StopRecord, ...] = (),
        order: OrderRow | None = None,
        preview: PreviewRequiredRow | None = None,
        approaches: tuple[tuple[str, ApproachRow], ...] = (),
        postures: tuple[tuple[str, PostureRow], ...] = (),
    ) -> None:
        """Restore queue, order, postures and latched stops of an earlier start. Nothing resumes by itself."""
        if order is not None:
            self._queue.order.restore(order)
        if preview is not None:
            self._previews.restore(preview)
        self._queue.approaches.restore(approaches)
        self._postures.restore(postures)
        self._queue.restore(rows)
        self._supervisor.restore(stops)

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """One control period.

        Args:
            inbox: What has arrived. The planner's `WorkPlan` and `Preview` and the ledger's `LedgerState` are in it.
            now: Monotonic time (s), the clock of the arrival times.

        Returns:
            Messages and requests to other processes; `Reply` to operators; `Records` for the ledger; `PlanRequest` and
            `PreviewRequest` for the planner.
        """
        self._event_log.now = now
        replies = []
        while (request := inbox.next_request()) is not None:
            replies.append(Reply(request, self._reply(request, now)))
        stops = self._update(inbox, now)
        supervisor = self._supervisor
        supervisor.review(stops, now)
        moved = self._move(now)
        cut = self._cut(*moved.cut) if moved.cut is not None and self.mode == "AUTO" else None
        joints, fencing = inbox.newest(m.JointState), supervisor.fencing
        motion = self._movement.send(moved.xi, fencing.token, joints, self.mode == "ESTOP_LATCHED")
        token = None if joints is None else fencing.request(joints.message.sequence, self.mode, now)
        release = supervisor.stops.release_due()
        calibration, self._calibration_due = self._calibration_due, None
        due = (token, supervisor.stop_due, motion, cut, self._picture(now), release, calibration)
        out: list[object] = [*replies, *(each for each in due if each is not None)]
        if now >= self._state_due:
            self._state_due = now + _STATE_S
            out += self._state(now)
        if supervisor.stops.changed:
            out.append(supervisor.stops.message())
        out += self._refused(inbox, now)
        out += self._event_log.drain()
        if records := self._journal.drain():
            out.append(Records(records))
        return out

    def end(self) -> list[object]:
        """The last message: another controller may command the robot."""
        return [self._supervisor.fencing.release_token()]

    def _reply(self, request: Request, now: float) -> m.Answer | None:
        """The answer of an operator's request; None where another controller has to answer."""
        if self.waits:
            return None
        intent: intents.Intent = request.message
        # The operator's view has aged while the request waited.
        aged = msgspec.structs.replace(intent, view_age_s=intent.view_age_s + max(0.0, now - request.at))
        return self.answer(aged, now)

    def _state(self, now: float) -> list[object]:
        """State for people, and requests to the planner."""
        asked = self._review(now), self._review_preview(now)
        preview, motion = self._previews.message(now), self._previews.motion(now)
        plan, state, control = self._plans.message(now), self._report(now), self._supervisor.authority.message(now)
        return [each for each in (state, control, preview, motion, plan, *asked) if each is not None]

    def _refused(self, inbox: Inbox, now: float) -> list[m.LogEvent]:
        """Log lines of refused messages and requests. They are not recorded: a flood must not fill the disk."""
        rejected = (each.message for each in inbox.drain(Rejected)[:_REPORTED])
        told = [reasons.message_rejected(each.topic, each.reason) for each in rejected]
        for answered in inbox.drain(Answered):
            if not answered.message.answer.ok:
                why = answered.message.answer.reason or reasons.unexplained()
                used = isinstance(answered.message.request, m.UseCalibration)
                told.append(reasons.calibration_refused(why) if used else reasons.release_refused(why))
        return [m.LogEvent(header=m.Header(now), process="controller", reason=reason) for reason in told]

    def answer(self, intent: intents.Intent, now: float) -> m.Answer:
        """Handle an intent. The answer has the reason of a refusal.

        Args:
            intent: The intent.
            now: Monotonic time (s).
        """
        self._event_log.now = now
        self._supervisor.authority.saw(intent, now)
        command = COMMAND_OF.get(type(intent))
        if command is None:
            unknown = reasons.command_unknown(type(intent).__name__)
            return m.Answer(ok=False, reason=unknown)
        reason = refusal(command, now, self._situation(now, intent)) or self._handlers[command.message](intent, now)
        row = RequestRow(asked=intent, reason=reason, mode=self.mode)
        self._journal.add("request", intent.user, row)
        if reason is not None:
            self._event_log.log(reasons.command_refused(intent.user, command.words, reason))
            return m.Answer(ok=False, reason=reason)
        if command.log is not None:
            self._event_log.log(command.log(intent))
        return m.Answer(ok=True)

    def _all_handlers(self) -> Handlers:
        """The handler of each command of the table."""
        decisions = QueueRequests(self._queue, self._event_log).handlers()
        turn = decisions[intents.SetApproach]
        handlers: Handlers = {
            **self._supervisor.authority.handlers(),
            **decisions,
            **self._previews.handlers(),
            **self._postures.handlers(),
            intents.SetApproach: lambda asked, now: self._being_worked_on(asked.point_id) or turn(asked, now),
            intents.Arm: self._change_mode,
            intents.Resume: self._change_mode,
            intents.Acknowledge: self._change_mode,
            intents.Start: self._start,
            intents.Continue: self._continue,
            intents.Survey: self._survey,
            intents.LookAgain: self._look_again,
            intents.CalibrateCamera: functools.partial(self._look_around, CALIBRATION),
            intents.CheckCamera: functools.partial(self._look_around, CHECK),
            intents.CalibrateBase: lambda asked, now: self._begin(asked, now, self._movement.sequence.drive_around),
            intents.UseBase: functools.partial(self._use, "base", reasons.no_base_offered),
            intents.CalibrateArm: functools.partial(self._look_around, ARM),
            intents.UseArm: functools.partial(self._use, "arm", reasons.no_arm_offered),
            intents.UseTiming: functools.partial(self._use, "timing", reasons.no_timing_offered),
            intents.Pause: self._pause,
            intents.Home: self._home,
            intents.Reset: lambda asked, now: self._supervisor.stops.ask_release(asked, self._supervisor.bridge, now),
        }
        # Asked for later, it would end the control loop.
        if missing := [message.__name__ for message in intents.INTENTS if message not in handlers]:
            raise ControlError(f"commands without a handler: {', '.join(missing)}; add one in controller/core.py")
        return handlers

    def _update(self, inbox: Inbox, now: float) -> tuple[m.StopRequest, ...]:
        """Take in what has arrived; returns the stops."""
        self._inbox = inbox
        recorded = inbox.newest(LedgerState)
        self._journal.observe(LedgerState() if recorded is None else recorded.message, now)
        stops = tuple(stop.message for stop in inbox.drain(m.StopRequest))
        self._journal.stops(stops)
        self._movement.update(inbox)
        self._supervisor.update(inbox, self._journal.trouble(now, self._config.supervision.ledger_max_age_s), now)
        sequence, bridge, points = self._movement.sequence, self._supervisor.bridge, inbox.newest(m.PruningPoints)
        if bridge is not None:
            close_up, sight = inbox.newest(CloseUpResult), inbox.newest(CutSight)
            level = self._movement.body.frame.level
            looked = None if close_up is None else level(close_up.message)
            on_the_way = None if sight is None else level(sight.message)
            for ended in sequence.watch(bridge, looked, on_the_way, now):
                self._event_log.log(ended)
        if points is not None and points is not self._points_seen:
            self._points_seen = points
            for voided in self._queue.update(points.message, sequence.in_canes):
                self._event_log.log(voided)
        if (back := self._queue.restored()) is not None:
            self._event_log.log(back)
        return stops

    def _move(self, now: float) -> MotionResult:
        """The motion of this period, and its effect on the mode."""
        supervisor = self._supervisor
        try:
            moved = self._movement.step(self.mode, supervisor.authority.held, now, supervisor.waits is not None)
        except ControlError as error:
            supervisor.event(Event.FAULT, now, reasons.motion_failed(str(error)))
            return self._movement.ramp()
        if moved.event is not None:
            event, why = moved.event
            supervisor.event(event, now, why)
        if moved.remark is not None:
            supervisor.remark(moved.remark)
        return moved

    def _cut(self, cut_id: str, point_id: str) -> m.CutCommand | None:
        token, joints = self._supervisor.fencing.token, self._inbox.newest(m.JointState)
        if token is None or joints is None:
            return None
        return m.CutCommand(
            epoch=token.epoch, token=token.nonce, echo=joints.message.sequence, cut_id=cut_id, point_id=point_id
        )

    def _picture(self, now: float) -> CloseUpRequest | None:
        token = self._supervisor.fencing.token
        due = None if token is None else self._movement.sequence.picture(now)
        if token is None or due is None:
            return None
        return CloseUpRequest(epoch=token.epoch, number=due[0], point_id=due[1])

    def _situation(self, now: float, intent: intents.Intent | None = None) -> Situation:
        supervisor, queue, previews = self._supervisor, self._queue, self._previews
        work: dict[Condition, m.Reason | None] = {
            "workable point": queue.waits,
            "interrupted work": self._continue_refused(),
            "acceptable point": queue.none_acceptable(),
            "voided acceptances": queue.undo_refused,
            "order by hand": queue.order.reset_refused,
            "approved preview": previews.start_refused(),
            "preview to approve": previews.approval_refused,
            "stop to release": supervisor.stops.reset_refused(supervisor.bridge, now),
        }
        return supervisor.situation(work, now, intent)

    def _continue_refused(self) -> m.Reason | None:
        """Why there is nothing to go on with; None if there is."""
        match self._supervisor.interrupted:
            case "work":
                return self._queue.waits or self._previews.start_refused()
            case "survey":
                return None
            case _:
                return reasons.nothing_interrupted()

    def _change_mode(self, asked: intents.Intent, now: float, event: Event | None = None) -> m.Reason | None:
        """Process an event, the command's own as a rule. A client that moves a robot without a holder gets control."""
        command, authority = COMMAND_OF[type(asked)], self._supervisor.authority
        client = client_of(asked)
        if command.control:
            authority.claim(client, now)
        caused = event or command.event
        if caused is None:
            return None
        reason = reasons.command_by(command.words, asked.user)
        return self._supervisor.event(caused, now, reason, authority.rights(client, asked.role))

    def _start(self, asked: intents.Start, now: float) -> m.Reason | None:
        return self._begin(asked, now, self._movement.sequence.start)

    def _continue(self, asked: intents.Continue, now: float) -> m.Reason | None:
        surveying, sequence = self._supervisor.interrupted == "survey", self._movement.sequence
        refused = self._movement.home_refused() if surveying else None
        if refused is None and self.mode == "PAUSED":
            refused = self._change_mode(asked, now, Event.RESUME)
        return refused or self._begin(asked, now, sequence.continue_survey if surveying else sequence.start)

    def _survey(self, asked: intents.Survey, now: float) -> m.Reason | None:
        survey = functools.partial(self._movement.sequence.survey, asked.distance)
        return self._movement.home_refused() or self._begin(asked, now, survey)

    def _look_again(self, asked: intents.LookAgain, now: float) -> m.Reason | None:
        place = open_place(self._queue.perceived, asked.vine, asked.spur)
        if place is None:
            return reasons.site_unknown(asked.vine, asked.spur)
        survey = functools.partial(self._movement.sequence.survey, place=place)
        return self._movement.home_refused() or self._begin(asked, now, survey)

    def _look_around(self, prefix: str, asked: intents.Start, now: float) -> m.Reason | None:
        return self._begin(asked, now, functools.partial(self._movement.look_around, prefix))

    @property
    def _offers(self) -> RobotCalibration:
        """New calibrations of the robot."""
        found = self._inbox.newest(RobotCalibration)
        return RobotCalibration(header=m.Header()) if found is None else found.message

    def _use(
        self,
        part: Literal["base", "arm", "timing"],
        none: Callable[[], m.Reason],
        asked: intents.UseBase | intents.UseArm | intents.UseTiming,
        now: float,
    ) -> m.Reason | None:
        """Have the bridge use the calibration that the operator saw; its log tells what becomes of it."""
        offer = getattr(self._offers, part)
        if offer is None or offer.made_at != asked.made_at:
            return none()
        self._calibration_due = m.UseCalibration(user=asked.user, **{part: offer})
        return None

    def _begin(self, asked: intents.Intent, now: float, work: Callable[[], None]) -> m.Reason | None:
        refused = self._change_mode(asked, now, Event.START)
        if refused is None:
            self._previews.start()
            work()
        return refused

    def _pause(self, asked: intents.Pause, now: float) -> m.Reason | None:
        if not self._movement.homing:
            return self._change_mode(asked, now)
        self._movement.stay()
        stopped = reasons.homing_stopped_by(asked.user)
        self._supervisor.remark(stopped)
        self._event_log.log(stopped)
        return None

    def _home(self, asked: intents.Home, now: float) -> m.Reason | None:
        if (refused := self._movement.home_refused()) is not None:
            return refused
        self._change_mode(asked, now)
        self._movement.go_home()
        self._supervisor.remark(reasons.homing_arm())
        return None

    def _being_worked_on(self, point_id: str) -> m.Reason | None:
        return reasons.point_worked_on(point_id) if point_id == self._movement.sequence.active else None

    def _review(self, now: float) -> PlanRequest | None:
        """Update the session's plan; returns the next request to the planner."""
        made = self._inbox.newest(WorkPlan)
        obstacles, movement = self._inbox.newest(Obstacles), self._movement
        measured = movement.body.measured
        return self._plans.review(
            made=None if made is None else made.message,
            q=None if measured is None else measured.in_map(movement.sequence.clear_of_canes(measured.q)),
            obstacles=() if obstacles is None else obstacles.message.capsules,
            at_rest=not movement.homing and self.mode != "TELEOP" and movement.at_rest,
            working=self.mode == "AUTO" and not movement.sequence.idle,
            now=now,
            busy=movement.sequence.active,
            close_up_s=movement.sequence.close_up_s,
        )

    def _known(self, ticket: Ticket) -> Found:
        """The known plan of a cut: that of the approved preview, else that of the session's plan."""
        return self._previews.known(ticket) or self._plans.known(ticket)

    def _review_preview(self, now: float) -> PreviewRequest | None:
        """Update the preview; returns the next request to the planner."""
        made = self._inbox.newest(Preview)
        obstacles, movement = self._inbox.newest(Obstacles), self._movement
        measured = movement.body.measured
        return self._previews.review(
            made=None if made is None else made.message,
            q=None if measured is None else measured.in_map(measured.q),
            obstacles=() if obstacles is None else obstacles.message.capsules,
            cuts=self._plans.cuts,
            at_rest=not movement.homing and self.mode != "TELEOP" and movement.at_rest,
            working=self.mode == "AUTO",
            close_up_s=movement.sequence.close_up_s,
            now=now,
        )

    def _report(self, now: float) -> m.ControllerState:
        movement = self._movement
        return controller_state(
            config=self._config,
            robot=movement.body.robot,
            state=self._supervisor.state,
            waits=self._supervisor.waits,
            phase=movement.sequence.phase,
            active=movement.sequence.active,
            measured=movement.body.measured,
            tracking=movement.tracking,
            allowed=allowed(now, self._situation(now)),
            inbox=self._inbox,
            queue=self._queue.entries(),
            nearest=movement.body.surroundings.model.nearest,
            order=self._queue.order.state,
            interrupted=self._supervisor.interrupted,
            relaxed_limits=self._relaxed_limits,
            postures=self._postures.all,
            tool_force=movement.body.contact.force,
            now=now,
        )
