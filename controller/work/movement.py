"""Motion sources by mode: cut sequence, teleoperation and homing. Permission is not decided here."""

from collections.abc import Callable

import numpy as np
from msgspec import Struct

from controller.config import ControllerConfig
from controller.identity import Token
from controller.ledger.journal import EventLogger
from controller.motion.body import Body
from controller.motion.follower import Measured, Tracking
from controller.motion.teleoperation import Teleoperation
from controller.whole_body.task import Method
from controller.work.back_off import BackOff
from controller.work.camera_views import BOARD, JOINTS, ROW, view_postures
from controller.work.cutting import CutSequence
from controller.work.homing import Homing
from controller.work.point_queue import PointQueue
from controller.work.posture_search import CutClearance, Known, Permit, PostureSearch
from controller.work.postures import PostureCheck
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Obstacles
from rolling_panda.mode_table import Event
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.inbox import Inbox, Received

#: Rest between a contact and the way back (s), in which the arm stops to swing.
_REST_S = 0.2


class MotionResult(Struct, frozen=True):
    """Result of one period.

    Attributes:
        xi: ξ̇ to send (9).
        cut: Cut to order, as cut id and point id; None without one.
        event: Event for the supervision state machine with its reason; None to stay in the mode.
        remark: New reason for the mode; None to keep it.
    """

    xi: Array
    cut: tuple[str, str] | None = None
    event: tuple[Event, m.Reason] | None = None
    remark: m.Reason | None = None


class Movement:
    """The robot's body and all motion sources. Call `update` with the inputs of each period, then `step`."""

    def __init__(
        self,
        config: ControllerConfig,
        robot_config: RobotConfig,
        queue: PointQueue,
        event_log: EventLogger,
        run_id: str,
        known: Known,
        method: Method | None = None,
        permit: Permit = lambda _: None,
        planned_from: Callable[[Array], bool] = lambda _: True,
        as_shown: Callable[[], bool] = lambda: False,
    ) -> None:
        """Build the robot's model and the motion sources.

        Args:
            config: Section `[controller]`.
            robot_config: Section `[robot]`.
            queue: The queue of points.
            event_log: Log of events.
            run_id: Prefix that makes the cut ids of this start unique.
            known: Gives the planned cut of a point.
            method: Whole-body method in place of the configured one.
            permit: Gives the reason why the robot may not approach a point; None if it may.
            planned_from: Whether the plan tells which points can be reached from a configuration (12, map); also True
                when no plan can be had.
            as_shown: Whether the work may take no other way than the one that was shown.

        Raises:
            ConfigError: There is no such method.
            ModelError: A robot description is missing.
        """
        self._config, self._event_log, self._queue = config, event_log, queue
        self.body = body = Body(config, robot_config, method)
        self._saturation, self._setpoints = body.saturation, body.setpoints
        self._clearance = CutClearance(RobotModel(robot_config), config.whole_body.hierarchy)
        search = PostureSearch(
            RobotModel(robot_config),
            config.work,
            config.whole_body.joint_margin,
            self._clearance,
        )
        self.sequence = CutSequence(
            config, search, body.follower, body.saturation, queue, run_id, known, permit, planned_from, as_shown
        )
        self.posture_check = PostureCheck(RobotModel(robot_config), config.whole_body)
        check = self.posture_check
        self.teleoperation = Teleoperation(
            config.teleoperation,
            config.work,
            body.follower,
            body.robot.drive,
            body.dt,
            check.refusal,
            check.tool_refusal,
        )
        model, home = RobotModel(robot_config), np.array(config.work.home)
        self._views = {views.prefix: view_postures(model, home, views) for views in (BOARD, JOINTS, ROW)}
        self._homing: Homing | None = None
        self._backs_off, self._rested = False, 0
        self._back_off: BackOff | None = None
        #: Tracking of the last step's motion; None without one.
        self.tracking: Tracking | None = None

    @property
    def homing(self) -> bool:
        """Whether the arm is being brought home."""
        return self._homing is not None

    @property
    def backing_off(self) -> bool:
        """Whether the robot stops after a contact, and goes back on its way."""
        return self._backs_off

    @property
    def at_rest(self) -> bool:
        """Whether the last commands are zero."""
        return self._setpoints.at_rest

    def unknown_motion(self, bridge: m.BridgeState) -> bool:
        """Whether the bridge moves the robot by a command that is none of this controller's, or was one to rest."""
        return bridge.moving and bridge.sequence > self._setpoints.moved

    def update(self, inbox: Inbox) -> None:
        """Update state and obstacles from what has arrived."""
        self.body.update(inbox)
        self.body.surroundings.work_at(self.sequence.places)
        self._clearance.update(inbox.newest(Obstacles), self._queue.canes)
        self.posture_check.update(self.body.obstacles)

    def look_around(self, prefix: str) -> None:
        """Begin to look at the calibration's board, or at the row, from several places."""
        self.sequence.look_around(prefix, self._views[prefix], self.posture_check.refusal)

    def home_refused(self) -> m.Reason | None:
        """Why the arm cannot be in its survey posture where the base stands; None if it can, or if that is unknown."""
        robot = self.body.measured
        return None if robot is None else self.posture_check.refusal(np.array(self._config.work.home), robot.q)

    def go_home(self) -> None:
        """Begin to bring the arm home."""
        self._homing = Homing(self._config, self.body.follower, self.body.dt)

    def stopped_by_contact(self) -> m.Reason | None:
        """Put off the present cut after a contact, and return what to log."""
        touch, robot = self.body.contact.touch, self.body.measured
        return None if touch is None or robot is None else self.sequence.stopped_by(touch, robot.frame)

    def back_off(self) -> None:
        """Plan the way back after a contact; it begins when the robot is at rest."""
        self._backs_off, self._back_off, self._rested = self._config.contact.back_off > 0.0, None, 0

    def stay(self) -> None:
        """Stop bringing the arm home, or going back."""
        self._homing, self._backs_off = None, False

    def leave(self, mode: m.Mode) -> None:
        """End the motion source of a mode that has ended."""
        self.stay()
        contact = self.body.contact
        contact.gives_way = contact.among = False
        contact.gave_way(free=True)
        if mode == "AUTO":
            self.sequence.abort()
        self.teleoperation.refuse()

    def busy(self, bridge: m.BridgeState | None) -> m.Reason | None:
        """Action that has to end before a motion may begin; None without one."""
        if self._homing is not None:
            return reasons.homing()
        if self.sequence.cutting or (bridge is not None and bridge.cutter == "closing"):
            return reasons.blades_closing()
        return None

    def ramp(self) -> MotionResult:
        """Come to rest, or stay there."""
        return MotionResult(self._saturation.ramp(self._setpoints.sent))

    def step(self, mode: m.Mode, held: bool, now: float, waits: bool = False) -> MotionResult:
        """One period.

        Args:
            mode: Mode of the supervision state machine.
            held: Whether a person has control.
            now: Monotonic time (s).
            waits: Whether the work stands for a while, to go on by itself.

        Raises:
            ControlError: The motion cannot be computed.
        """
        self.tracking = None
        robot = self.body.measured
        if mode == "PROTECTIVE_STOP" and self._backs_off and robot is not None and held:
            return self._go_back(robot)
        self._backs_off = False
        self.body.contact.clear()
        if robot is None or not held or mode not in ("READY", "TELEOP", "AUTO"):
            return self.ramp()
        if mode == "TELEOP":
            if (refused := self.teleoperation.refused(robot)) is not None:
                return MotionResult(self._saturation.ramp(self._setpoints.sent), event=(Event.RELEASE, refused))
            self.tracking = self.teleoperation.step(robot)
            return MotionResult(self.tracking.xi)
        if mode == "READY":
            return self._bring_home(robot)
        if waits:
            self.sequence.hold()
            return self.ramp()
        return self._work(robot, now)

    def send(
        self, xi: Array, token: Token | None, joints: Received[m.JointState] | None, latched: bool
    ) -> m.MotionCommand | None:
        """The command for ξ̇ (9). If it is not finite or outside the limits, the robot brakes instead.

        Args:
            xi: Desired ξ̇.
            token: Fencing token; without one nothing is sent.
            joints: Newest joint state, for the echo.
            latched: Whether a stop is latched. Then nothing is sent once the robot is at rest.
        """
        if not self._setpoints.admits(xi):
            self._event_log.log(reasons.velocity_withheld())
        xi = self._setpoints.smooth(xi)
        if token is None or joints is None or (latched and not xi.any()):
            self._setpoints.withhold()
            return None
        return self._setpoints.command(xi, token, joints.message.sequence)

    def _work(self, robot: Measured, now: float) -> MotionResult:
        contact = self.body.contact
        if (told := self.sequence.pushed(contact, self.body.trail, robot.frame)) is not None:
            self._event_log.log(told)
        work = self.sequence.step(robot, now)
        contact.gives_way, contact.among = self.sequence.may_give_way, bool(self.sequence.in_canes)
        self.tracking = work.tracking
        for event in work.events:
            self._event_log.log(event)
        change = None
        if work.pause is not None:
            change = Event.LOST, work.pause
        elif work.finished:
            change = Event.FINISHED, work.summary
        return MotionResult(work.xi, work.cut, change)

    def _go_back(self, robot: Measured) -> MotionResult:
        if self._back_off is None:
            # Blades that close are not pulled away from what they hold.
            self._rested = self._rested + 1 if self.at_rest and not self.sequence.cutting else 0
            if self._rested * self.body.dt >= _REST_S:
                self._back_off = BackOff(
                    self._config.motion, self.body.trail, self._config.contact.back_off, self.body.dt
                )
            return self.ramp()
        if self._back_off.done:
            self._event_log.log(reasons.backed_off() if self._back_off.arrived else reasons.not_backed_off())
            self._backs_off = False
            return self.ramp()
        self.tracking = self._back_off.step(robot, self.body.follower, self.body.contact.load)
        return MotionResult(self.tracking.xi)

    def _bring_home(self, robot: Measured) -> MotionResult:
        homing = self._homing
        if homing is None:
            return self.ramp()
        xi = homing.step(robot)
        if homing.blocked:
            self._homing, why = None, reasons.homing_blocked(homing.blocked)
            self._event_log.log(why)
            return MotionResult(xi, remark=why)
        if homing.done:
            self._homing = None
            self._event_log.log(reasons.arm_home())
            return MotionResult(xi, remark=reasons.arm_home())
        return MotionResult(xi)
