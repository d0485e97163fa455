"""The cut sequence: posture search, travel, approach, advance, cut, retreat, next cut.

Between cuts the tool keeps `clearance` from the canes. It moves into them and out of them on one straight line; near
the cut (`arm_only`) the base is at rest. The posture search for the next cut runs while the blades close, so that the
retreat from one cut blends into the motion to the next.

Each stage is a class with the data that it needs. Its `step` answers with the stage of the next period and the result
of this one.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np

from controller.config import ControllerConfig, WorkConfig
from controller.motion.contact import ContactMonitor, Touch
from controller.motion.follower import Follower, Measured, MotionTimeout, Tracking, missed
from controller.motion.surroundings import WorkPlace
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.saturation import Saturation
from controller.work.back_off import BackOff, Trail
from controller.work.base_views import BaseViews
from controller.work.camera_views import CameraViews, Refusal
from controller.work.close_up import CloseUpClient, PostCutCheck, camera_ready, no_picture, not_as_accepted
from controller.work.homing import Withdrawal
from controller.work.point_queue import TOLD_MOVED, PointQueue
from controller.work.posture_search import (
    CutPlan,
    Fitted,
    Known,
    NextCut,
    Permit,
    PostureSearch,
    Unreachable,
    escape_pose,
)
from controller.work.servo import CutServo
from controller.work.step_result import StepResult
from controller.work.survey import Survey
from controller.work.tries import Line, Tried
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import ON_THE_WAY, CloseUpResult, CutSight
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import ARM_Q, ARM_XI, on_plane
from rolling_panda.model.wire_values import vector3

#: A cut command is repeated this often until the bridge has seen it (s).
_REPEAT_S = 0.05
_OUTCOMES: dict[str, Reason] = {
    "DONE": reasons.cutter_cut(),
    "FAILED_NOT_CUT": reasons.cutter_missed(),
    "UNKNOWN": reasons.cutter_unsure(),
}


Ended = Callable[[str, m.Outcome, Reason, float], None]


@dataclass
class _Cut:
    """A cut in progress: the blades may have moved."""

    point_id: str
    cut_id: str
    tried: Tried
    deadline: float
    record: int
    asked_at: float = -math.inf


class Blades:
    """Orders cuts, one at a time, and passes the outcome of each to the queue."""

    def __init__(self, config: WorkConfig, queue: PointQueue, run_id: str, ended: Ended | None = None) -> None:
        """Bind the parts.

        Args:
            config: Section `[controller.work]`.
            queue: The queue, which gets the outcomes.
            run_id: Prefix that makes the cut ids of this start unique.
            ended: Called with the cutter's report in place of the queue: point, outcome, reason, time.
        """
        self._ended = ended
        self._timeout_s, self._queue, self._run_id = config.cut_timeout_s, queue, run_id
        self._cuts = 0
        self._cut: _Cut | None = None

    @property
    def busy(self) -> bool:
        """Whether a cut has been asked for and how it ends is not known yet: the blades may be closing."""
        return self._cut is not None

    def start(self, point_id: str, tried: Tried, now: float) -> None:
        """Intend a cut at a point; no command is sent before that intent is durable.

        Args:
            point_id: Of the point.
            tried: What counts as tried if no order is given.
            now: Monotonic time (s).
        """
        self._cuts += 1
        cut_id = f"{self._run_id}-{self._cuts}"
        self._cut = _Cut(point_id, cut_id, tried, now + self._timeout_s, self._queue.begin_cut(point_id, cut_id))

    def command(self, now: float) -> tuple[str, str] | None:
        """(cut_id, point_id) to command in this period; None between repetitions and before the intent is durable."""
        cut = self._cut
        if cut is None or now - cut.asked_at < _REPEAT_S or not self._queue.recorded(cut.record):
            return None
        cut.asked_at = now
        return cut.cut_id, cut.point_id

    def watch(self, bridge: m.BridgeState, now: float) -> tuple[Reason, ...]:
        """Update the cut from the bridge's state; returns what is logged."""
        cut = self._cut
        if cut is None:
            return ()
        if bridge.cut_id == cut.cut_id and bridge.outcome:
            self._cut = None
            why = _OUTCOMES[bridge.outcome]
            if self._ended is not None:
                self._ended(cut.point_id, bridge.outcome, why, now)
            else:
                self._queue.resolve(cut.point_id, bridge.outcome, why)
            told = reasons.cut_done if bridge.outcome == "DONE" else reasons.cut_ended
            return (told(cut.point_id, why),)
        if now > cut.deadline and cut.asked_at == -math.inf:
            self._cut = None
            why = reasons.no_order_given(self._timeout_s)
            return (self._queue.put_off(cut.point_id, cut.tried, reasons.missed_once(why), why),)
        if now > cut.deadline:
            self._cut = None
            why = reasons.no_cutter_report(self._timeout_s)
            self._queue.resolve(cut.point_id, "UNKNOWN", why)
            return (reasons.outcome_unknown(cut.point_id, why),)
        return ()


class ApproachSegments:
    """Segments for a method that blends them, or for one that stops between them."""

    def __init__(self, config: WorkConfig, flows: bool) -> None:
        """Bind the configuration."""
        self._config, self._flows = config, flows

    def to(self, plan: CutPlan, T_odom_tool: Any, q: Array) -> tuple[Leg, ...]:
        """Segments from a tool pose (pin.SE3) at q (12) to a cut, or to the pose of a close-up before it."""
        there = self.there(plan, T_odom_tool, q)
        return there if self._config.pre_cut_check else (*there, self.into(plan))

    def there(self, plan: CutPlan, T_odom_tool: Any, q: Array) -> tuple[Leg, ...]:
        """From a pose of the tool (pin.SE3) at q (12) to clear of the canes before a cut."""
        speed = self._config.tool_speed
        if self._flows:
            return (Leg(plan.poses.clear, plan.q_clear, speed),)
        # The base moves with the arm at rest; then the arm moves alone.
        q_there = at_base(q, plan.q_clear)
        carried = on_plane(q_there) * on_plane(q).inverse() * T_odom_tool
        return Leg(carried, q_there, speed), Leg(plan.poses.clear, plan.q_clear, speed, math.inf)

    def into(self, plan: CutPlan) -> Leg:
        """Straight in, from clear of the canes to the cut."""
        config = self._config
        return Leg(plan.poses.cut, plan.q_cut, config.advance_speed, config.arm_only if self._flows else math.inf)

    def out(self, plan: CutPlan, q: Array) -> Leg:
        """Straight back, from the cut to clear of the canes with the base at q (12)."""
        arm_only = self._config.arm_only if self._flows else math.inf
        return Leg(plan.poses.clear, at_base(plan.q_clear, q), self._config.tool_speed, frozen_until=arm_only)


def at_base(q_arm: Array, q_base: Array) -> Array:
    """The arm posture of one configuration (12) with the base of another."""
    out = q_base.copy()
    out[ARM_Q] = q_arm[ARM_Q]
    return out


#: Smaller refinements of a point by perception are ignored (m).
_REFINED = 0.0003
#: The tool is among the canes if it is nearer to them than their clearance by more than this (m).
_AMONG = 0.03
#: Distance to the end of a motion at which the next one begins (m).
_NEAR = 0.02
#: Where the way out leads.
_CLEAR: Final[reasons.Goal] = "a place clear of the canes"


@dataclass
class Parts:
    """Parts that all stages share, and the little that outlives a stage.

    Attributes:
        config: Section `[controller]`.
        follower: Follower of tool motions.
        saturation: Braking to rest.
        queue: The queue of points.
        segments: Segments of the motion to a cut and out again.
        close_ups: Client for pictures.
        servo: Corrects the motion to a cut by pictures on the way.
        post_cut_check: Check of the last cuts.
        blades: Orders the cuts.
        search: Posture search.
        next_cut: The same for the next point.
        planned_from: Whether the plan tells which points can be reached from a configuration (12, map); also True when
            no plan can be had.
        as_shown: Whether the work may take no other way than the one that was shown.
        ending: Reason to begin no further cut; None without one.
        cut_point: Point of the last cut; empty before the first.
        cut_at: Position of the tool at the last cut (3, m, odom itself: the base may stand otherwise when it is seen).
        gave_way: Times that it gave way to canes since the last cut.
    """

    config: ControllerConfig
    follower: Follower
    saturation: Saturation
    queue: PointQueue
    segments: ApproachSegments
    close_ups: CloseUpClient
    servo: CutServo
    post_cut_check: PostCutCheck
    blades: Blades
    search: PostureSearch
    next_cut: NextCut
    planned_from: Callable[[Array], bool]
    as_shown: Callable[[], bool]
    ending: m.Reason | None = None
    cut_point: str = ""
    cut_at: Array = field(default_factory=lambda: np.zeros(3))
    gave_way: int = 0

    def look_back(self, robot: Measured, now: float) -> None:
        """Request the close-up of the last cut once the tool is far enough from it.

        During the retreat, without a stop: one picture is enough to see that the wood is gone.
        """
        cut_at = robot.frame.levelled(self.cut_at)
        if math.dist(robot.kinematics.T_odom_tool.translation, cut_at) > self.config.work.close_up_from:
            self.post_cut_check.request_close_up(self.cut_point, cut_at, now)

    def refine(self, task: "CutTask", motion: ToolMotion, frame: MapFrame) -> None:
        """Correct a motion to the newest, more accurate position of its point."""
        ticket = self.queue.get(task.point_id)
        if ticket is None:
            return
        place = np.array(ticket.point.position) + task.planned.along * np.array(ticket.point.tangent)
        _shift(motion, frame.position_in_odom(place))

    def brake(self, robot: Measured, pause: m.Reason | None = None) -> StepResult:
        """Come to rest, or stay there; with a reason the work pauses."""
        return StepResult(self.saturation.ramp(robot.sent), pause=pause)

    def withdrawal(self, robot: Measured, goal: Any, posture: Array) -> Withdrawal | None:
        """The arm's way by its joints to a tool pose (pin.SE3); None where none is found.

        Its end is sought from the arm's own posture, and then from `posture` (7, rad).
        """
        clear = self.search.arm_at(goal, robot.q, robot.q[ARM_Q], posture)
        return None if clear is None else Withdrawal(self.config, self.follower, robot.q, clear)

    def unwinding(self, robot: Measured) -> Withdrawal | None:
        """The arm's way home by its joints from a posture that no plan has; None where it has another one.

        Also None where that would bring the tool nearer to the row. From such a posture, at a joint limit or a
        singularity, the next way would end in a worse one.
        """
        home = robot.q.copy()
        home[ARM_Q] = self.config.work.home
        if self.search.tenable(robot.q) or not self.search.leads_away(robot.q, home, robot.frame):
            return None
        return Withdrawal(self.config, self.follower, robot.q, home)


class FollowedMotion:
    """A tool motion under way, with its timeout."""

    def __init__(self, parts: Parts, robot: Measured, *legs: Leg, to_cut: bool = False) -> None:
        """Plan from the measured tool pose, not the desired one: a motion begins at rest.

        Args:
            parts: Of the sequence.
            robot: Measured robot.
            legs: Segments.
            to_cut: Whether the last one ends at a cut, or at the close-up before one.
        """
        config, self._follower = parts.config, parts.follower
        self.motion = ToolMotion(
            config.motion,
            config.whole_body,
            robot.kinematics.T_odom_tool,
            robot.q,
            legs,
            slow_end=to_cut and not config.work.pre_cut_check,
            flows=parts.follower.flows,
            waits=to_cut and config.work.pre_cut_check,
        )
        self.timeout = MotionTimeout(config.work.reach_timeout_s, 1.0 / config.rate_hz)
        self.timeout.start(self.motion.duration)

    def track(self, robot: Measured) -> Tracking:
        """Follow for one period."""
        tracking = self._follower.follow(self.motion, robot)
        self.timeout.note(tracking)
        return tracking

    def hold(self) -> None:
        """The robot stands for one period, which is no delay of this motion."""
        self.timeout.again()


@dataclass(frozen=True, eq=False)
class CutTask:
    """A cut under way.

    Attributes:
        point_id: The point.
        accepted: The point as accepted; the plan is for one acceptance.
        planned: Poses and postures in map.
        frame: Where odom is in map.
        turned: Whether a close-up has had it approached another way than planned.
        arranged: Whether the arm has been brought into the planned posture by its joints.
    """

    point_id: str
    accepted: m.PruningPoint | None
    planned: CutPlan
    frame: MapFrame
    turned: bool = False
    arranged: bool = False

    @cached_property
    def plan(self) -> CutPlan:
        """Poses and postures in odom."""
        return self.planned.in_odom(self.frame)

    @property
    def work_place(self) -> WorkPlace:
        """Where the blades work, in odom."""
        return WorkPlace.of(self.plan.poses.cut.translation, self.accepted)

    @property
    def accepted_in_odom(self) -> Array | None:
        """Place of the acceptance (3, m, odom); None without one."""
        return None if self.accepted is None else self.frame.position_in_odom(np.array(self.accepted.position))


class Holds(Protocol):
    """A motion whose timeouts can leave a period out."""

    def hold(self) -> None:
        """The robot stands for one period."""


class Stage(ABC):
    """A stage of the sequence."""

    #: Phase on the wire.
    phase: m.Phase = ""
    #: Whether the tool hides the point from the camera.
    in_canes = False
    #: Whether the push of a known cane is no contact.
    yields = False
    #: Point of the stage; empty without one.
    point_id = ""

    def __init__(self, parts: Parts, motion: Holds | None = None) -> None:
        """Bind the parts, and the motion that the stage follows, if there is one."""
        self._parts, self._motion = parts, motion

    @property
    def plan(self) -> CutPlan | None:
        """Plan of the cut under way, in odom; None without one."""
        return None

    @property
    def tasks(self) -> tuple[CutTask, ...]:
        """The cuts that the motion begins or ends at."""
        return ()

    def hold(self) -> None:
        """The robot stands in this period, in place of `step`. No timeout counts it."""
        if self._motion is not None:
            self._motion.hold()

    @abstractmethod
    def step(self, robot: Measured, now: float) -> "Step":
        """One period.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """

    def _left(self, point_id: str, accepted: m.PruningPoint | None) -> m.Reason | None:
        """Why the point may no longer be approached; None if it may."""
        ticket = self._parts.queue.get(point_id)
        if ticket is None:
            why = reasons.point_gone()
        elif ticket.state != "ACCEPTED":
            why = ticket.reason or reasons.point_state(point_id, ticket.state)
        elif ticket.accepted is not accepted:
            why = reasons.accepted_again()
        elif (refused := self._parts.next_cut.permit(ticket)) is not None:
            why = refused
        else:
            return None
        return reasons.point_left(point_id, why)

    def _escape(self, robot: Measured, now: float, why: m.Reason) -> "Step":
        """Leave the point, from outside the canes."""
        stage, result = Escape(self._parts).step(robot, now)
        return stage, result.with_event(why)

    def _fail(self, robot: Measured, point_id: str, reason: m.Reason) -> "Step":
        told = self._parts.queue.give_up(point_id, reason)
        return Escape(self._parts), self._parts.brake(robot).with_event(told)


#: Stage of the next period, and the result of this one.
Step = tuple[Stage, StepResult]


#: Rest between a push and the way back (s), in which the arm stops to swing.
_REST_S = 0.2
#: After so many pushes without a cut between them a person has to look.
_PUSHES = 3
#: An arm that is so far from its posture (rad), where the tool hardly moves, is brought into it before the canes are
#: entered: below this share of the manipulability at which the tool moves well.
_ASTRAY, _HARDLY = 0.6, 0.5
#: Longest wait for a plan at the end of the work (s).
_PLAN_WAIT_S = 15.0


class Rest(Stage):
    """At rest: choose the next point and search its posture.

    A point that the plan refused may be within reach from the last cut. So the work does not end on such a point before
    a plan from there has refused it as well.
    """

    def __init__(self, parts: Parts) -> None:
        """Nothing is waited for."""
        super().__init__(parts)
        self._since: float | None = None
        #: Whether no point is left that can be reached.
        self.idle = False

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts = self._parts
        xi, following = parts.saturation.ramp(robot.sent), parts.next_cut
        if following.search(robot.in_map(robot.q)):
            return Search(parts, following.point_id, following.accepted), StepResult(xi)
        self.idle = following.refused is None
        beyond = parts.queue.count("UNREACHABLE")
        if beyond and self.idle and self._plan_due(robot, now):
            return self, StepResult(xi)
        # The last cut may still have to be made once more.
        summary = following.refused or (reasons.work_done_but(beyond) if beyond else reasons.work_done())
        return self, StepResult(xi, finished=not parts.post_cut_check.pending, summary=summary)

    def _plan_due(self, robot: Measured, now: float) -> bool:
        if self._parts.planned_from(robot.in_map(robot.q)):
            return False
        self._since = now if self._since is None else self._since
        return now - self._since < _PLAN_WAIT_S


class Escape(Stage):
    """Begin to move the tool clear of the canes, if it is among them."""

    phase: m.Phase = "RETREAT"

    def __init__(self, parts: Parts, unwinds: bool = True) -> None:
        """With `unwinds` the arm then goes home if it is in a posture that no plan has."""
        super().__init__(parts)
        self._unwinds = unwinds

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        config = self._parts.config.work
        clear = escape_pose(config, robot.kinematics.T_odom_tool, robot.frame, _AMONG)
        if clear is None:
            return _rest_clear(self, self._parts, self._unwinds, robot, now)
        leg = Leg(clear, robot.q, config.advance_speed, math.inf)
        return Escaping(self._parts, FollowedMotion(self._parts, robot, leg), self._unwinds).step(robot, now)


class Escaping(Stage):
    """Moving the tool straight clear of the canes."""

    phase: m.Phase = "RETREAT"
    yields = True

    def __init__(self, parts: Parts, way: FollowedMotion, unwinds: bool) -> None:
        """Along `way`; `unwinds` as of `Escape`."""
        super().__init__(parts, way)
        self._way, self._unwinds = way, unwinds

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, tracking = self._parts, self._way.track(robot)
        if self._way.timeout.over(tracking, now, _NEAR):
            return _rest_clear(self, parts, self._unwinds, robot, now)
        if not self._way.timeout.late(now):
            return self, StepResult(tracking.xi, tracking)
        withdrawal = parts.withdrawal(robot, self._way.motion.goal, np.array(parts.config.work.home))
        if withdrawal is None:
            return self, parts.brake(robot, missed(_CLEAR, tracking))
        return EscapingByJoints(parts, withdrawal), StepResult(tracking.xi, tracking)


def _rest_clear(stage: Stage, parts: Parts, unwinds: bool, robot: Measured, now: float) -> Step:
    """At the end of `stage`, with the tool clear of the canes: rest, in a posture from which a way may begin."""
    unwinding = parts.unwinding(robot) if unwinds else None
    if unwinding is None:
        return Rest(parts).step(robot, now)
    # One motion ends, and the other begins, at rest.
    return (stage if np.any(robot.sent) else EscapingByJoints(parts, unwinding)), parts.brake(robot)


class EscapingByJoints(Stage):
    """Moving the tool clear of the canes, or the arm home, by the arm's joints. The base rests."""

    phase: m.Phase = "RETREAT"
    yields = True

    def __init__(self, parts: Parts, withdrawal: Withdrawal) -> None:
        """To where `withdrawal` leads."""
        super().__init__(parts, withdrawal)
        self._withdrawal = withdrawal

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        tracking = self._withdrawal.step(robot, now)
        if self._withdrawal.done:
            return Rest(self._parts).step(robot, now)
        if self._withdrawal.late:
            return self, self._parts.brake(robot, self._withdrawal.missed(_CLEAR, robot))
        return self, StepResult(tracking.xi, tracking)


class Search(Stage):
    """Posture search, with the robot at rest."""

    phase: m.Phase = "APPROACH"

    def __init__(self, parts: Parts, point_id: str, accepted: m.PruningPoint | None) -> None:
        """For one acceptance of a point."""
        super().__init__(parts)
        self.point_id, self._accepted = point_id, accepted

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts = self._parts
        if left := self._left(self.point_id, self._accepted):
            return self._escape(robot, now, left)
        if parts.ending:
            return self, parts.brake(robot, parts.ending)
        result = parts.brake(robot)
        parts.next_cut.step()
        found = parts.next_cut.found
        if isinstance(found, Unreachable):
            return self._fail(robot, self.point_id, reasons.not_reachable(found.reason))
        if found is None or np.any(robot.sent):
            return self, result
        task = CutTask(self.point_id, self._accepted, found, robot.frame)
        legs = parts.segments.to(task.plan, robot.kinematics.T_odom_tool, robot.q)
        way = FollowedMotion(parts, robot, *legs, to_cut=True)
        return Travel(parts, task, way), result


class GivingWay(Stage):
    """Back on the way that it came, since a known cane pushes; then clear of the canes."""

    phase: m.Phase = "RETREAT"
    in_canes = True
    yields = True

    def __init__(self, parts: Parts, contact: ContactMonitor, trail: Trail) -> None:
        """From a push on the way to a cut.

        Args:
            parts: Of the sequence.
            contact: What the arm feels.
            trail: The way here.
        """
        super().__init__(parts)
        self._contact, self._trail = contact, trail
        self._rested = 0
        self._back: BackOff | None = None

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, config = self._parts, self._parts.config
        dt = 1.0 / config.rate_hz
        if self._back is None:
            self._rested = 0 if np.any(robot.sent) else self._rested + 1
            if self._rested * dt >= _REST_S:
                self._back = BackOff(config.motion, self._trail, config.contact.back_off, dt)
            return self, parts.brake(robot)
        if not self._back.done:
            # A hard push is a contact, which ends the work.
            tracking = self._back.step(robot, parts.follower, load=0.0)
            return self, StepResult(tracking.xi, tracking)
        free = self._back.arrived and (self._contact.force or 0.0) < config.contact.stop_force
        self._contact.gave_way(free)
        return Escape(parts), parts.brake(robot)


class TaskStage(Stage):
    """A stage of a cut under way."""

    yields = True

    def __init__(self, parts: Parts, task: CutTask, motion: Holds | None = None) -> None:
        """For one cut."""
        super().__init__(parts, motion)
        self._task, self.point_id = task, task.point_id

    @property
    def plan(self) -> CutPlan:
        """Plan of the cut under way."""
        return self._task.plan

    @property
    def tasks(self) -> tuple[CutTask, ...]:
        """The cuts that the motion begins or ends at."""
        return (self._task,)


class MovingStage(TaskStage):
    """A stage of a cut with a tool motion."""

    def __init__(self, parts: Parts, task: CutTask, way: FollowedMotion) -> None:
        """For one cut, along `way`."""
        super().__init__(parts, task, way)
        self._way = way

    def _follow_drift(self, robot: Measured) -> None:
        """Lead the motion to where the cut is in odom now, with the tool clear of the canes."""
        if robot.frame is self._task.frame:
            return
        before = self._task.plan
        self._task = replace(self._task, frame=robot.frame)
        plan, motion = self._task.plan, self._way.motion
        motion.shift(plan.poses.clear.translation - before.poses.clear.translation, (plan.q_clear - before.q_clear)[:2])

    def _another_time(self, robot: Measured, why: m.Reason, from_another_side: bool = True) -> Step:
        """Leave the cut for another try, after the others. The tool is still clear of the canes."""
        again = reasons.missed_once(why) if from_another_side else reasons.not_seen_once(why)
        told = self.put_off(again, why, from_another_side=from_another_side)
        return Escape(self._parts), self._parts.brake(robot).with_event(told)

    def put_off(
        self, again: m.Reason, why: m.Reason, met: Line | None = None, from_another_side: bool = True
    ) -> m.Reason:
        """Leave the cut for another try, after the others.

        Args:
            again: Reason while the cut is to be tried again.
            why: Reason where this was the last try.
            met: Axis of the cane in the way (m, map); None without one.
            from_another_side: Whether the next try takes another approach.

        Returns:
            What is logged.
        """
        parts = self._parts
        # Nothing that was found before leads to the next try.
        parts.next_cut.forget()
        parts.close_ups.forget(self.point_id)
        approach = self._task.planned.approach if from_another_side else None
        return parts.queue.put_off(self.point_id, Tried(approach, met), again, why)

    def _retreat(self, robot: Measured) -> "Retreat":
        """Straight out of the canes, and on to the next cut where one is found."""
        parts, following = self._parts, self._parts.next_cut
        tool = robot.kinematics.T_odom_tool.translation
        parts.cut_at, parts.cut_point = robot.frame.tilted(tool).copy(), self.point_id
        back = parts.segments.out(self._task.plan, robot.q)
        ticket, found = parts.queue.get(self.point_id), following.found
        unsure = ticket is not None and ticket.state == "UNKNOWN"
        if isinstance(found, CutPlan) and following.stands and not unsure and not parts.ending:
            onwards = CutTask(following.point_id, following.accepted, found, robot.frame)
            legs = parts.segments.to(onwards.plan, back.goal, back.q_goal)
            return Retreat(parts, self._task, FollowedMotion(parts, robot, back, *legs, to_cut=True), onwards)
        following.forget()
        return Retreat(parts, self._task, FollowedMotion(parts, robot, back))


class Travel(MovingStage):
    """On the way to the stand-off, or to the place of the close-up."""

    phase: m.Phase = "APPROACH"

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, config, timeout, motion = self._parts, self._parts.config, self._way.timeout, self._way.motion
        if left := self._left(self.point_id, self._task.accepted):
            return self._escape(robot, now, left)
        if parts.ending:
            return self, parts.brake(robot, parts.ending)
        self._follow_drift(robot)
        if not config.work.pre_cut_check:
            parts.refine(self._task, motion, robot.frame)
        parts.look_back(robot, now)
        tracking = self._way.track(robot)
        result = StepResult(tracking.xi, tracking)
        last = motion.leg == motion.legs - 1
        if last and not config.work.pre_cut_check:
            return Advance(parts, self._task, self._way), result
        failed = any(tried.approach is not None for tried in parts.queue.tries.of(self.point_id))
        if last and camera_ready(robot, motion, config.work, self._task.turned or failed):
            if self._astray(robot, tracking.manipulability):
                return Arranging(parts, self._task, self._way), parts.brake(robot)
            parts.close_ups.ask(self.point_id, "seen", now, self._task.accepted_in_odom)
            timeout.again()
            return CloseUp(parts, self._task, self._way), result
        if not (config.work.pre_cut_check and timeout.over(tracking, now, 0.0)) and timeout.late(now):
            why = missed("the stand-off", tracking)
            # What stops it would do so again. Else the base is elsewhere, on wheels that have slipped, or the arm is
            # in a posture in which the tool hardly moves.
            return self._another_time(robot, why) if tracking.feasible else self._fail(robot, self.point_id, why)
        return self, result

    def _astray(self, robot: Measured, manipulability: float) -> bool:
        """Whether the arm is in another posture than planned, in which the tool hardly moves."""
        off = np.abs(robot.q[ARM_Q] - self._way.motion.posture().q[ARM_Q]).max()
        hardly = _HARDLY * self._parts.config.whole_body.hierarchy.good_manipulability
        return not self._task.arranged and float(off) > _ASTRAY and manipulability < hardly


class Arranging(MovingStage):
    """The arm moves by its joints into the planned posture, with the tool clear of the canes.

    The way of the tool from the last cut has led it into another one, near a singularity.
    """

    phase: m.Phase = "APPROACH"

    def __init__(self, parts: Parts, task: CutTask, way: FollowedMotion) -> None:
        """For one cut, from the end of `way`."""
        super().__init__(parts, replace(task, arranged=True), way)
        self._arm: Withdrawal | None = None

    def hold(self) -> None:
        """The robot stands in this period."""
        if self._arm is not None:
            self._arm.hold()

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, plan = self._parts, self._task.plan
        if left := self._left(self.point_id, self._task.accepted):
            return self._escape(robot, now, left)
        if parts.ending:
            return self, parts.brake(robot, parts.ending)
        if self._arm is None or self._arm.done:
            # One motion ends, and the other begins, at rest.
            if np.any(robot.sent):
                return self, parts.brake(robot)
            if self._arm is not None:
                legs = parts.segments.to(plan, robot.kinematics.T_odom_tool, robot.q)
                way = FollowedMotion(parts, robot, *legs, to_cut=True)
                return Travel(parts, self._task, way), parts.brake(robot)
            self._arm = Withdrawal(parts.config, parts.follower, robot.q, plan.q_clear)
        tracking = self._arm.step(robot, now)
        if self._arm.late:
            return self._another_time(robot, self._arm.missed("the stand-off", robot))
        return self, StepResult(tracking.xi, tracking)


class CloseUp(MovingStage):
    """Wait for the close-up before the canes are entered; its result decides whether the point is cut."""

    phase: m.Phase = "CLOSE_UP"

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts = self._parts
        if left := self._left(self.point_id, self._task.accepted):
            return self._escape(robot, now, left)
        if parts.ending:
            return self, parts.brake(robot, parts.ending)
        self._follow_drift(robot)
        tracking, close_up = self._way.track(robot), parts.close_ups.answer(self.point_id, now)
        result = StepResult(tracking.xi, tracking)
        if close_up is None:
            return self, result
        parts.close_ups.forget(self.point_id)
        ticket = parts.queue.get(self.point_id)
        if close_up.finding == "severed" and (told := parts.post_cut_check.is_off(self.point_id)):
            # The next period leaves it.
            return self, result.with_event(told)
        if why := not_as_accepted(close_up, ticket):
            # A cane that sways, or that lacks depth, may seem severed or changed though it is neither.
            if close_up.finding != "seen" and not parts.queue.last_try(self.point_id):
                return self._another_time(robot, why, from_another_side=not no_picture(close_up))
            parts.queue.void(self.point_id, why)
            # The next period leaves it.
            return self, result
        return Fitting(parts, self._task, self._way, robot, np.array(close_up.position)), result


class Fitting(MovingStage):
    """Check the way in to where the close-up has seen the cut. The tool is still clear of the canes.

    The newest map counts. Where the planned approach has no room there or beside it on the same wood, another one is
    taken, and a close-up from there checks again. Without one the cut is put off.
    """

    phase: m.Phase = "CLOSE_UP"

    def __init__(self, parts: Parts, task: CutTask, way: FollowedMotion, robot: Measured, seen: Array) -> None:
        """For a cut that was `seen` somewhere (3, m, odom), with the tool clear of the canes."""
        super().__init__(parts, replace(task, frame=robot.frame), way)
        self._seen, queue, point = seen, parts.queue, task.accepted
        assert point is not None
        self._fit = parts.search.fit(
            task.planned,
            point,
            robot.frame.position_in_map(seen),
            queue.approaches.of(task.point_id),
            queue.tries.of(task.point_id),
            others=not task.turned and not parts.as_shown(),
        )
        self._fitted: Fitted | None = None

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts = self._parts
        if left := self._left(self.point_id, self._task.accepted):
            return self._escape(robot, now, left)
        if parts.ending:
            return self, parts.brake(robot, parts.ending)
        fitted = self._fitted = self._fitted or self._search()
        if fitted is None:
            tracking = self._way.track(robot)
            return self, StepResult(tracking.xi, tracking)
        if fitted.plan is not None and fitted.plan.approach == self._task.planned.approach:
            return self._enter(robot, fitted.plan)
        if np.any(robot.sent):
            # Another motion begins at rest.
            return self, parts.brake(robot)
        return self._turn(robot, fitted)

    def _search(self) -> Fitted | None:
        for _ in range(self._parts.config.search_steps_each):
            try:
                next(self._fit)
            except StopIteration as end:
                fitted: Fitted = end.value
                return fitted
        return None

    def _enter(self, robot: Measured, plan: CutPlan) -> Step:
        """Straight in, to where the cut was seen."""
        parts, motion, known = self._parts, self._way.motion, self._task.accepted_in_odom
        motion.extend(replace(parts.segments.into(self._task.plan), q_goal=plan.q_cut))
        _shift(motion, self._task.frame.position_in_odom(plan.poses.cut.translation))
        parts.servo.begin(self.point_id, self._seen, motion.goal.rotation)
        self._way.timeout.start(motion.duration)
        tracking = self._way.track(robot)
        result = StepResult(tracking.xi, tracking)
        moved = 0.0 if known is None else math.dist(self._seen, known)
        if moved > TOLD_MOVED:
            result = result.with_event(reasons.cut_where_seen(self.point_id, 1e3 * moved))
        if plan.along:
            result = result.with_event(reasons.cut_where_room(self.point_id, 1e3 * abs(plan.along)))
        return Advance(parts, replace(self._task, planned=plan), self._way), result

    def _turn(self, robot: Measured, fitted: Fitted) -> Step:
        """Another way to where the cut was seen, else none."""
        parts, task, why = self._parts, self._task, fitted.lacking or reasons.unexplained()
        if fitted.plan is None:
            return self._another_time(robot, reasons.no_room_where_seen(why))
        task = replace(task, planned=fitted.plan, turned=True)
        legs = parts.segments.to(task.plan, robot.kinematics.T_odom_tool, robot.q)
        way = FollowedMotion(parts, robot, *legs, to_cut=True)
        return Travel(parts, task, way), parts.brake(robot).with_event(reasons.turned_where_seen(self.point_id, why))


class Advance(MovingStage):
    """Straight into the canes.

    Where a close-up has told the place, the way ends there. From now on the tool hides it from the camera, and where
    odom is in map may be told otherwise meanwhile. How the base stands is known all the time.
    """

    phase: m.Phase = "ADVANCE"
    in_canes = True

    def _follow_ground(self, robot: Measured) -> None:
        """Keep the goal in its place in odom while the base rolls over uneven ground."""
        before, now = self._task.frame, robot.frame
        if now.T_odom_level is before.T_odom_level:
            return
        self._task = replace(self._task, frame=replace(before, T_odom_level=now.T_odom_level))
        goal = self._way.motion.goal.translation
        moved = now.levelled(before.tilted(goal)) - goal
        self._way.motion.shift(moved)
        self._parts.servo.carry(moved)

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, config, timeout, motion = self._parts, self._parts.config, self._way.timeout, self._way.motion
        left = self._left(self.point_id, self._task.accepted)
        if left or parts.ending:
            stage, result = self._retreat(robot).step(robot, now)
            return stage, result.with_event(left) if left else result
        self._follow_ground(robot)
        if config.work.pre_cut_check:
            parts.servo.correct(motion, robot)
        else:
            parts.refine(self._task, motion, robot.frame)
        tracking = self._way.track(robot)
        result = StepResult(tracking.xi, tracking)
        there = timeout.over(tracking, now, config.work.position_tolerance, config.work.rotation_tolerance)
        # At the end of the motion, not during it.
        rests = there and float(np.linalg.norm(robot.kinematics.J_xi[:3] @ tracking.xi)) < config.work.settle_speed
        if rests and np.abs(tracking.xi[ARM_XI]).max() >= config.work.settle_joints:
            # Remaining corrections beside the tool's path can wait: the blades close at rest.
            motion.settle(robot.q)
            rests = False
        if rests:
            parts.blades.start(self.point_id, Tried(self._task.planned.approach), now)
            parts.gave_way = 0
            told = parts.servo.told(now)
            return Cutting(parts, self._task, self._way), result.with_event(told) if told else result
        if timeout.late(now):
            reason = missed("the cut", tracking)
            told = self.put_off(reasons.missed_once(reason), reason)
            return self._retreat(robot), result.with_event(told)
        return self, result


_WayIn = Travel | Arranging | CloseUp | Fitting | Advance


def _axis_in_map(touch: Touch, frame: MapFrame) -> Line | None:
    """Axis of the wood that was touched (m, map); None where it is unknown."""
    if touch.axis is None:
        return None
    start, end = (vector3(frame.position_in_map(np.array(each))) for each in touch.axis)
    return start, end


class Cutting(MovingStage):
    """The blades close, while the posture for the next cut is searched."""

    phase: m.Phase = "CUT"
    in_canes = True
    # Blades that close are not pulled away from what they hold.
    yields = False

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        blades, following, tracking = self._parts.blades, self._parts.next_cut, self._way.track(robot)
        if not blades.busy:
            return self._retreat(robot), StepResult(tracking.xi, tracking)
        if following.search(robot.in_map(robot.q)):
            following.step()
        return self, StepResult(tracking.xi, tracking, cut=blades.command(now))


class LeavingStage(TaskStage):
    """A stage of the retreat."""

    phase: m.Phase = "RETREAT"
    in_canes = True

    def _out(self, robot: Measured, tracking: Tracking, now: float) -> Step:
        """Clear of the canes, with no next cut under way."""
        ticket = self._parts.queue.get(self.point_id)
        if ticket is not None and ticket.state == "UNKNOWN":
            why = ticket.reason or reasons.cutter_unsure()
            return self, StepResult(tracking.xi, tracking, pause=reasons.outcome_unknown(self.point_id, why))
        return Rest(self._parts).step(robot, now)


class Retreat(LeavingStage):
    """Straight out of the canes, and on to the next cut."""

    def __init__(self, parts: Parts, task: CutTask, way: FollowedMotion, onwards: CutTask | None = None) -> None:
        """From one cut, along `way`, which leads `onwards` if there is a next one."""
        super().__init__(parts, task, way)
        self._way, self._onwards = way, onwards

    @property
    def tasks(self) -> tuple[CutTask, ...]:
        """The cuts that the motion begins or ends at."""
        return (self._task,) if self._onwards is None else (self._task, self._onwards)

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        parts, timeout = self._parts, self._way.timeout
        parts.look_back(robot, now)
        tracking = self._way.track(robot)
        result = StepResult(tracking.xi, tracking)
        if self._way.motion.leg > 0 and self._onwards is not None:
            # Clear of the canes, and the motion to the next cut has begun.
            return Travel(parts, self._onwards, self._way), result
        if timeout.over(tracking, now, _NEAR):
            return self._out(robot, tracking, now)
        if timeout.late(now):
            # The base may have gone on, so that the planned posture would have the tool elsewhere.
            plan = self._task.planned.in_odom(robot.frame)
            withdrawal = parts.withdrawal(robot, plan.poses.clear, plan.q_clear[ARM_Q])
            if withdrawal is None:
                return self, parts.brake(robot, missed("the way back", tracking))
            event = reasons.retreat_by_joints(self.point_id, missed("the way back", tracking))
            return Withdraw(parts, self._task, withdrawal), result.with_event(event)
        return self, result


class Withdraw(LeavingStage):
    """Out of the canes by joints, after the straight retreat has failed."""

    def __init__(self, parts: Parts, task: CutTask, withdrawal: Withdrawal) -> None:
        """From one cut."""
        super().__init__(parts, task, withdrawal)
        self._withdrawal = withdrawal

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        self._parts.look_back(robot, now)
        tracking = self._withdrawal.step(robot, now)
        if self._withdrawal.late:
            return self, self._parts.brake(robot, self._withdrawal.missed("the way back", robot))
        if self._withdrawal.done:
            return self._out(robot, tracking, now)
        return self, StepResult(tracking.xi, tracking)


class Surveying(Stage):
    """Driving along the row."""

    phase: m.Phase = "SURVEY"

    def __init__(self, parts: Parts, survey: Survey) -> None:
        """With one survey."""
        super().__init__(parts, survey)
        self._survey = survey

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        if self._parts.ending:
            return self, self._parts.brake(robot, self._parts.ending)
        return self, self._survey.step(robot, now)


class Calibrating(Stage):
    """Looking at the calibration's board, or at the row, from several postures of the arm or places of the base."""

    phase: m.Phase = "CALIBRATION"

    def __init__(self, parts: Parts, views: CameraViews | BaseViews) -> None:
        """With one round of pictures."""
        super().__init__(parts, views)
        self._views = views

    def step(self, robot: Measured, now: float) -> Step:
        """One period."""
        if self._parts.ending:
            return self, self._parts.brake(robot, self._parts.ending)
        return self, self._views.step(robot, now)


def _shift(motion: ToolMotion, position: Array) -> None:
    """Move a motion's goal to a position (3, m, odom), unless it is there already."""
    moved = position - motion.goal.translation
    if float(np.linalg.norm(moved)) > _REFINED:
        motion.shift(moved)


#: Largest number of pictures of one close-up, and while they are not conclusive: in low sun each lacks other depth.
_PICTURES, _BLIND_PICTURES = 2, 4


class CutSequence:
    """Executes the queue. Call `start` once, `step` in each period in AUTO, and `abort` in other modes."""

    def __init__(
        self,
        config: ControllerConfig,
        search: PostureSearch,
        follower: Follower,
        saturation: Saturation,
        queue: PointQueue,
        run_id: str,
        known: Known = lambda _: None,
        permit: Permit = lambda _: None,
        planned_from: Callable[[Array], bool] = lambda _: True,
        as_shown: Callable[[], bool] = lambda: False,
    ) -> None:
        """Bind the parts.

        `run_id` makes the cut ids of this start unique. `known` gives the planned cut of a point, and
        `permit` the reason why the robot may not approach it. `planned_from` and `as_shown` are as in `Parts`.
        """
        close_ups = CloseUpClient(config.work.close_up_timeout_s, _PICTURES, _BLIND_PICTURES)
        check = PostCutCheck(queue, close_ups, config.work.post_cut_check)
        self._parts = Parts(
            config,
            follower,
            saturation,
            queue,
            ApproachSegments(config.work, follower.flows),
            close_ups,
            CutServo(config.work),
            check,
            Blades(config.work, queue, run_id, check.start),
            search,
            NextCut(search, queue, config.search_steps_each, known, permit),
            planned_from,
            as_shown,
        )
        self._stage: Stage = Rest(self._parts)
        self._survey: Survey | None = None
        #: The push on the last way out, which may last until the next way in has begun.
        self._pushed: Touch | None = None
        self._places: tuple[WorkPlace, ...] = ()

    @property
    def phase(self) -> m.Phase:
        """Phase on the wire."""
        return self._stage.phase

    @property
    def active(self) -> str:
        """Current point of the work; empty without one."""
        return self._stage.point_id

    @property
    def idle(self) -> bool:
        """Whether no point is left that can be reached."""
        return isinstance(self._stage, Rest) and self._stage.idle

    @property
    def in_canes(self) -> str:
        """Point that the tool hides from the camera now; empty without one."""
        return self._stage.point_id if self._stage.in_canes else ""

    @property
    def plan(self) -> CutPlan | None:
        """Poses and postures of the cut under way; None while there is none."""
        return self._stage.plan

    @property
    def places(self) -> tuple[WorkPlace, ...]:
        """Cuts that the motion under way begins or ends at (odom): the blades may touch the wood there."""
        return self._places

    @property
    def close_up_s(self) -> float:
        """Time from the request of the last close-up to its result (s)."""
        return self._parts.close_ups.took_s

    def clear_of_canes(self, q: Array) -> Array:
        """Configuration (12) clear of the canes before the next point, from q (12); q itself outside the canes."""
        plan = self._stage.plan
        return at_base(plan.q_clear, q) if self._stage.in_canes and plan is not None else q

    @property
    def cutting(self) -> bool:
        """Whether a cut has been asked for and how it ends is not known yet: the blades may be closing."""
        return self._parts.blades.busy

    def start(self) -> None:
        """Start with getting the tool clear of the canes."""
        # Since a plan was made the robot may have been moved by hand.
        self._parts.next_cut.forget()
        self._stage = Escape(self._parts, unwinds=False)

    def survey(self, distance: float = 0.0, place: m.UndecidedSite | None = None) -> None:
        """Start a survey of this length (m), or of one site."""
        parts = self._parts
        parts.next_cut.forget()
        self._survey = Survey(parts.config, parts.follower, parts.saturation, parts.queue, distance, place)
        self._stage = Surveying(parts, self._survey)

    def continue_survey(self) -> None:
        """Go on with the last survey, which was interrupted."""
        if self._survey is not None:
            self._parts.next_cut.forget()
            self._survey.go_on()
            self._stage = Surveying(self._parts, self._survey)

    def look_around(self, prefix: str, postures: tuple[Array, ...], refusal: Refusal) -> None:
        """Start to take pictures from these postures of the arm (7, rad); `refusal` judges each."""
        parts = self._parts
        parts.next_cut.forget()
        views = CameraViews(parts.config, parts.follower, parts.saturation, parts.close_ups, prefix, postures, refusal)
        self._stage = Calibrating(parts, views)

    def drive_around(self) -> None:
        """Start to drive and turn before the calibration's board."""
        parts = self._parts
        parts.next_cut.forget()
        self._stage = Calibrating(parts, BaseViews(parts.config, parts.follower, parts.saturation, parts.close_ups))

    def finish_cut_and_pause(self, why: m.Reason | None) -> None:
        """With a reason: begin no further cut, leave the canes and pause. None continues the work."""
        self._parts.ending = why

    def abort(self) -> None:
        """Abort the work. A cut in progress is still monitored, and an accepted point stays accepted."""
        self._stage = Rest(self._parts)

    def watch(
        self, bridge: m.BridgeState, close_up: CloseUpResult | None, sight: CutSight | None, now: float
    ) -> tuple[m.Reason, ...]:
        """Process the end of a cut and the newest pictures, in every mode; returns what is logged.

        Args:
            bridge: State of the bridge.
            close_up: Result of the newest close-up.
            sight: What the newest picture on the way to a cut shows.
            now: Monotonic time (s).
        """
        parts = self._parts
        if sight is not None:
            parts.servo.update(sight, now)
        if close_up is not None:
            parts.close_ups.update(close_up, now)
        return *parts.blades.watch(bridge, now), *parts.post_cut_check.step(now)

    def picture(self, now: float) -> tuple[int, str] | None:
        """Number and point of the picture to ask for in this period; None when none is due."""
        close_ups, servo = self._parts.close_ups, self._parts.servo
        due = close_ups.due(now)
        if due is None and isinstance(self._stage, Advance) and servo.due(now) and (number := close_ups.number()):
            servo.asked(number, now)
            due = number, f"{ON_THE_WAY}{servo.point_id}"
        return due

    @property
    def may_give_way(self) -> bool:
        """Whether a known cane that pushes now is no contact."""
        return self._stage.yields and (not isinstance(self._stage, _WayIn) or self._parts.gave_way < _PUSHES)

    def pushed(self, contact: ContactMonitor, trail: Trail, frame: MapFrame) -> m.Reason | None:
        """React to the push of a known cane: on the way to a cut put it off and go back, on the way out go on.

        Args:
            contact: What the arm feels, with the push.
            trail: The way here.
            frame: Where odom is in map.

        Returns:
            What is logged; None without news.
        """
        parts, stage, push = self._parts, self._stage, contact.push
        if push is None or push.axis is None or isinstance(stage, GivingWay):
            return None
        what = push.part, push.obstacle, float(np.linalg.norm(push.force))
        if push is self._pushed or not isinstance(stage, _WayIn):
            # The way back would lead into the canes.
            news, self._pushed = push is not self._pushed, push
            if not contact.beyond:
                contact.gave_way(free=True)
            return reasons.cane_on_way_out(*what) if news else None
        parts.gave_way += 1
        self._stage = GivingWay(parts, contact, tuple(trail))
        return stage.put_off(reasons.cane_met(*what), reasons.cane_in_way(*what), _axis_in_map(push, frame))

    def stopped_by(self, touch: Touch, frame: MapFrame) -> m.Reason | None:
        """A contact stops the robot. On the way to a cut it is put off, so that the next try comes from elsewhere.

        Args:
            touch: The contact.
            frame: Where odom is in map.

        Returns:
            What is logged; None without news.
        """
        stage, why = self._stage, touch.reason
        if not isinstance(stage, _WayIn):
            return None
        return stage.put_off(reasons.missed_once(why), why, _axis_in_map(touch, frame))

    def hold(self) -> None:
        """Stand for one period in place of `step`. A close-up or a cut that was asked for goes on."""
        self._stage.hold()

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period of work.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        self._stage, result = self._stage.step(robot, now)
        if tasks := self._stage.tasks:
            # While the tool leaves the canes there is no cut under way; it is still near the last one.
            self._places = tuple(task.work_place for task in tasks)
        return result
