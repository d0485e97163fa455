"""The cut sequence: posture search, travel, approach, advance, cut, retreat, next cut.

Between cuts the tool keeps `clearance` from the canes. It moves into them and out of them on one straight line, with
the base at rest. The posture search for the next cut runs while the blades close, so that the retreat from one cut
blends into the motion to the next.
"""

import math
from collections.abc import Callable

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import Follower, Measured, Tracking
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.saturation import Saturation
from controller.work.approach_segments import ApproachSegments, at_base
from controller.work.blades import Blades
from controller.work.close_up import CloseUpClient
from controller.work.cut_checks import PostCutCheck, camera_ready, not_as_accepted
from controller.work.cut_pose import escape_pose
from controller.work.homing import Withdrawal
from controller.work.motion_timeout import MotionTimeout, missed
from controller.work.next_cut import Known, NextCut, Permit
from controller.work.point_queue import PointQueue
from controller.work.posture_search import CutPlan, PostureSearch, Unreachable
from controller.work.stages import PHASES, Stage, StepResult
from controller.work.survey import Survey
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_XI

#: Smaller refinements of a point by perception are ignored (m).
_REFINED = 0.0003
#: Largest number of pictures of one close-up.
_PICTURES = 2
#: Distance to the end of a motion at which the next one begins (m).
_NEAR = 0.02


class CutSequence:
    """Executes the queue. Call `begin` once, `step` in each period in AUTO, and `abort` in other modes."""

    def __init__(
        self,
        config: ControllerConfig,
        search: PostureSearch,
        follower: Follower,
        saturation: Saturation,
        queue: PointQueue,
        run_id: str,
        known: Known = lambda _: None,
        permit: Permit = lambda _: "",
    ) -> None:
        """Bind the parts.

        `run_id` makes the cut ids of this start unique. `known` gives the planned cut of a point, and
        `permit` the reason why the robot may not approach it.
        """
        self._config, self._follower = config, follower
        self._saturation, self._queue = saturation, queue
        self._left = np.array([-np.sin(config.row_heading), np.cos(config.row_heading), 0.0])
        self._events: list[str] = []
        self._motion: ToolMotion | None = None
        self._timeout = MotionTimeout(config.reach_timeout_s, 1.0 / config.rate_hz)
        self._plan: CutPlan | None = None
        self._withdrawal: Withdrawal | None = None
        self._accepted: m.PruningPoint | None = None
        self._survey = Survey(config, follower, saturation, queue)
        self._places: tuple[Array, ...] = ()
        self._segments = ApproachSegments(config, follower.flows)
        self._close_ups = CloseUpClient(config.close_up_timeout_s, _PICTURES)
        self._post_cut_check = PostCutCheck(queue, self._close_ups, config.post_cut_check)
        self._blades = Blades(config, queue, run_id, self._post_cut_check.start)
        self._next_cut = NextCut(search, queue, config.search_steps_each, known, permit)
        #: Position of the last cut (m, odom), and its point.
        self._cut_at: Array = np.zeros(3)
        #: Perception's position of the point at the close-up, which is more accurate.
        self._close_up_of: m.Vector3 | None = None
        self._ending = self._cut_point = ""
        self._forget()

    @property
    def phase(self) -> m.Phase:
        """Phase on the wire."""
        return PHASES[self._stage]

    @property
    def active(self) -> str:
        """Current point of the work; empty without one."""
        return self._point_id

    @property
    def in_canes(self) -> str:
        """Point that the tool hides from the camera now; empty without one."""
        return self._point_id if self._stage in (Stage.ADVANCE, Stage.CUT, Stage.RETREAT) else ""

    @property
    def plan(self) -> CutPlan | None:
        """Poses and postures of the cut under way; None while there is none."""
        return self._plan

    @property
    def places(self) -> tuple[Array, ...]:
        """Cuts that the motion under way begins or ends at (3, m, odom): the blades may touch the spurs there."""
        return self._places

    @property
    def close_up_s(self) -> float:
        """Time from the request of the last close-up to its result (s)."""
        return self._close_ups.took_s

    def clear_of_canes(self, q: Array) -> Array:
        """Configuration (12) clear of the canes before the next point, from q (12); q itself outside the canes."""
        return at_base(self._plan.q_clear, q) if self.in_canes and self._plan is not None else q

    @property
    def cutting(self) -> bool:
        """Whether a cut has been asked for and how it ends is not known yet: the blades may be closing."""
        return self._blades.busy

    def start(self, survey: intents.Survey | intents.LookAgain | None = None) -> None:
        """Start with getting the tool clear of the canes, or a survey."""
        self._forget()
        # Since a plan was made the robot may have been moved by hand.
        self._next_cut.forget()
        self._stage = Stage.SURVEY if survey is not None else Stage.ESCAPE
        self._survey = Survey(self._config, self._follower, self._saturation, self._queue, survey)

    def finish_cut_and_pause(self, why: str) -> None:
        """With a reason: begin no further cut, leave the canes and pause. Empty continues the work."""
        self._ending = why

    def abort(self) -> None:
        """Abort the work. A cut in progress is still monitored, and an accepted point stays accepted."""
        self._forget()

    def watch(self, bridge: m.BridgeState, close_up: CloseUpResult | None, now: float) -> tuple[str, ...]:
        """Process the end of a cut and the newest close-up, in every mode; returns log texts."""
        if close_up is not None:
            self._close_ups.update(close_up, now)
        return *self._blades.watch(bridge, now), *self._post_cut_check.step(now)

    def picture(self, now: float) -> tuple[int, str] | None:
        """Number and point of the picture to ask for in this period; None when none is due."""
        return self._close_ups.due(now)

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period of work.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        self._events = []
        if self._stage in (Stage.SEARCH, Stage.TRAVEL, Stage.CLOSE_UP, Stage.ADVANCE):
            self._check_acceptance(robot)
        if self._ending and self._stage in (Stage.SEARCH, Stage.TRAVEL, Stage.CLOSE_UP, Stage.SURVEY):
            return StepResult(self._saturation.ramp(robot.sent), pause=self._ending)
        if self._ending and self._stage is Stage.ADVANCE:
            self._retreat_from(robot)
        if self._stage is Stage.ADVANCE or (self._stage is Stage.TRAVEL and not self._config.pre_cut_check):
            self._refine()
        if self._stage in (Stage.RETREAT, Stage.TRAVEL):
            if math.dist(robot.kinematics.T_odom_tool.translation, self._cut_at) > self._config.close_up_from:
                # During the retreat, without a stop: one picture is enough to see that the wood is gone.
                self._post_cut_check.request_close_up(self._cut_point, now)
        work = _STEPS[self._stage](self, robot, now)
        onwards = self._next_cut.found if self._stage is Stage.RETREAT else None
        plans = [plan for plan in (self._plan, onwards) if isinstance(plan, CutPlan)]
        if plans:
            # While the tool leaves the canes there is no plan; it is still near the last cut.
            self._places = tuple(plan.poses.cut.translation for plan in plans)
        return work if not self._events else work.with_events(tuple(self._events))

    # --- stages ------------------------------------------------------------------------------------------------------

    def _escape(self, robot: Measured, now: float) -> StepResult:
        if self._motion is None:
            pose = robot.kinematics.T_odom_tool
            limit = self._config.row_distance - self._config.clearance
            depth = float(pose.translation @ self._left) - limit - 0.03
            if depth <= 0.0:
                return self._next(robot)
            self._go(robot, Leg(escape_pose(pose, self._left, depth), robot.q, self._config.advance_speed, math.inf))
        tracking = self._track(robot)
        if self._timeout.over(tracking, now, _NEAR):
            return self._next(robot)
        if self._timeout.late(now):
            return StepResult(self._saturation.ramp(robot.sent), pause=missed("a place clear of the canes", tracking))
        return StepResult(tracking.xi, tracking)

    def _next(self, robot: Measured) -> StepResult:
        """Choose the next point and search its posture, with the robot at rest."""
        self._forget()
        if not self._next_cut.search(robot.q):
            # The last cut may still have to be made once more.
            beyond = self._queue.count("UNREACHABLE")
            unreachable = f"; {beyond} cannot be reached" if beyond else ""
            summary = self._next_cut.refused or f"{StepResult.summary}{unreachable}"
            finished = not self._post_cut_check.pending
            return StepResult(self._saturation.ramp(robot.sent), finished=finished, summary=summary)
        self._point_id, self._accepted, self._stage = self._next_cut.point_id, self._next_cut.accepted, Stage.SEARCH
        return StepResult(self._saturation.ramp(robot.sent))

    def _find(self, robot: Measured, now: float) -> StepResult:
        xi, coming = self._saturation.ramp(robot.sent), self._next_cut
        coming.step()
        if isinstance(coming.found, Unreachable):
            return self._fail(robot, f"not reachable: {coming.found.reason}")
        if coming.found is None or np.any(robot.sent):
            return StepResult(xi)
        self._plan = coming.found
        self._stage = Stage.TRAVEL
        self._go(robot, *self._segments.to(self._plan, robot.kinematics.T_odom_tool, robot.q), to_cut=True)
        return StepResult(xi)

    def _travel(self, robot: Measured, now: float) -> StepResult:
        tracking = self._track(robot)
        assert self._motion is not None
        last = self._motion.leg == self._motion.legs - 1
        if last and not self._config.pre_cut_check:
            self._stage = Stage.ADVANCE
        elif last and camera_ready(robot, self._motion, self._config):
            self._close_ups.ask(self._point_id, "seen", now)
            self._timeout.again()
            self._stage = Stage.CLOSE_UP
        elif not (self._config.pre_cut_check and self._timeout.over(tracking, now, 0.0)) and self._timeout.late(now):
            return self._fail(robot, missed("the stand-off", tracking))
        return StepResult(tracking.xi, tracking)

    def _close_up(self, robot: Measured, now: float) -> StepResult:
        """Wait for the close-up before the canes are entered; its result decides whether the point is cut."""
        tracking, close_up = self._track(robot), self._close_ups.answer(self._point_id, now)
        if close_up is None:
            return StepResult(tracking.xi, tracking)
        self._close_ups.forget(self._point_id)
        ticket = self._queue.get(self._point_id)
        assert self._motion is not None and self._plan is not None
        why = not_as_accepted(close_up, ticket, self._config.moved_tolerance)
        if why:
            self._queue.void(self._point_id, why)
            # The next period leaves it.
            return StepResult(tracking.xi, tracking)
        assert ticket is not None
        self._close_up_of = ticket.point.position
        self._motion.extend(self._segments.into(self._plan))
        moved = np.array(close_up.position) - self._motion.goal.translation
        if float(np.linalg.norm(moved)) > _REFINED:
            self._motion.shift(moved)
        self._timeout.start(self._motion.duration)
        self._stage = Stage.ADVANCE
        return StepResult(tracking.xi, tracking)

    def _advance(self, robot: Measured, now: float) -> StepResult:
        tracking, config = self._track(robot), self._config
        there = self._timeout.over(tracking, now, config.position_tolerance, config.rotation_tolerance)
        # At the end of the motion, not during it.
        rests = there and float(np.linalg.norm(robot.kinematics.J_xi[:3] @ tracking.xi)) < config.settle_speed
        if rests and self._motion is not None and np.abs(tracking.xi[ARM_XI]).max() >= config.settle_joints:
            # Remaining corrections beside the tool's path can wait: the blades close at rest.
            self._motion.settle(robot.q)
            rests = False
        if rests:
            self._blades.start(self._point_id, now)
            self._stage = Stage.CUT
        elif self._timeout.late(now):
            reason = missed("the cut", tracking)
            self._queue.resolve(self._point_id, "FAILED_NOT_CUT", reason)
            self._events.append(f"{self._point_id}: not cut: {reason}")
            self._retreat_from(robot)
        return StepResult(tracking.xi, tracking)

    def _cutting(self, robot: Measured, now: float) -> StepResult:
        tracking = self._track(robot)
        if not self._blades.busy:
            self._retreat_from(robot)
        elif self._next_cut.search(robot.q):
            self._next_cut.step()
        return StepResult(tracking.xi, tracking, cut=self._blades.command(now))

    def _retreat(self, robot: Measured, now: float) -> StepResult:
        if self._withdrawal is not None:
            return self._withdraw(self._withdrawal, robot, now)
        tracking = self._track(robot)
        assert self._motion is not None and self._plan is not None
        plan = self._next_cut.found
        if self._motion.leg > 0 and isinstance(plan, CutPlan):
            # Clear of the canes, and the motion to the next cut has begun.
            self._plan, self._stage = plan, Stage.TRAVEL
            self._point_id, self._accepted = self._next_cut.point_id, self._next_cut.accepted
            return StepResult(tracking.xi, tracking)
        if self._timeout.over(tracking, now, _NEAR):
            return self._out(robot, tracking)
        if self._timeout.late(now):
            self._events.append(f"{self._point_id}: {missed('the way back', tracking)}; now by joints")
            self._withdrawal = Withdrawal(self._config, self._follower, robot.q, self._plan.q_clear)
        return StepResult(tracking.xi, tracking)

    def _withdraw(self, withdrawal: Withdrawal, robot: Measured, now: float) -> StepResult:
        tracking = withdrawal.step(robot, now)
        if withdrawal.late:
            return StepResult(self._saturation.ramp(robot.sent), pause=missed("the way back", tracking))
        return self._out(robot, tracking) if withdrawal.done else StepResult(tracking.xi, tracking)

    def _out(self, robot: Measured, tracking: Tracking) -> StepResult:
        ticket = self._queue.get(self._point_id)
        if ticket is not None and ticket.state == "UNKNOWN":
            return StepResult(tracking.xi, tracking, pause=f"{self._point_id} is UNKNOWN: {ticket.reason}")
        return self._next(robot)

    # --- parts -------------------------------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._stage = Stage.REST
        self._point_id = ""
        self._accepted = None
        self._close_up_of = None
        self._motion = self._plan = self._withdrawal = None
        self._timeout.again()

    def _check_acceptance(self, robot: Measured) -> None:
        ticket = self._queue.get(self._point_id)
        if ticket is not None and ticket.state == "ACCEPTED":
            # The plan is for one acceptance. It is invalid for a point that was accepted again.
            why = self._next_cut.permit(ticket) if ticket.accepted is self._accepted else "it was accepted again"
            if not why:
                return
        else:
            why = ticket.reason if ticket is not None else "the point has gone"
        self._events.append(f"{self._point_id}: left: {why}")
        if self._stage is Stage.ADVANCE:
            self._retreat_from(robot)
        else:
            self._forget()
            self._stage = Stage.ESCAPE

    def _refine(self) -> None:
        """Correct the motion to the newest, more accurate position of the accepted point."""
        ticket = self._queue.get(self._point_id)
        if ticket is None or self._motion is None or ticket.point.position == self._close_up_of:
            return
        moved = np.array(ticket.point.position) - self._motion.goal.translation
        if float(np.linalg.norm(moved)) > _REFINED:
            self._motion.shift(moved)

    def _retreat_from(self, robot: Measured) -> None:
        assert self._plan is not None
        self._stage, self._withdrawal = Stage.RETREAT, None
        self._cut_at, self._cut_point = robot.kinematics.T_odom_tool.translation.copy(), self._point_id
        back = self._segments.out(self._plan, robot.q)
        ticket, plan = self._queue.get(self._point_id), self._next_cut.found
        unsure = ticket is not None and ticket.state == "UNKNOWN"
        stands = isinstance(plan, CutPlan) and self._next_cut.stands and not unsure and not self._ending
        onwards = self._segments.to(plan, back.goal, back.q_goal) if stands and isinstance(plan, CutPlan) else ()
        if not onwards:
            self._next_cut.forget()
        self._go(robot, back, *onwards, to_cut=bool(onwards))

    def _fail(self, robot: Measured, reason: str) -> StepResult:
        self._queue.resolve(self._point_id, "FAILED_NOT_CUT", reason)
        self._events.append(f"{self._point_id}: not cut: {reason}")
        self._forget()
        self._stage = Stage.ESCAPE
        return StepResult(self._saturation.ramp(robot.sent))

    def _go(self, robot: Measured, *legs: Leg, to_cut: bool = False) -> None:
        # From the measured tool pose, not the desired one: a motion begins at rest.
        check = self._config.pre_cut_check
        self._motion = ToolMotion(
            self._config,
            robot.kinematics.T_odom_tool,
            robot.q,
            legs,
            slow_end=to_cut and not check,
            flows=self._follower.flows,
            waits=to_cut and check,
        )
        self._timeout.start(self._motion.duration)

    def _track(self, robot: Measured) -> Tracking:
        assert self._motion is not None
        tracking = self._follower.follow(self._motion, robot)
        self._timeout.note(tracking)
        return tracking


_STEPS: dict[Stage, Callable[[CutSequence, Measured, float], StepResult]] = {
    Stage.REST: lambda sequence, robot, now: sequence._next(robot),
    Stage.ESCAPE: CutSequence._escape,
    Stage.SEARCH: CutSequence._find,
    Stage.TRAVEL: CutSequence._travel,
    Stage.CLOSE_UP: CutSequence._close_up,
    Stage.ADVANCE: CutSequence._advance,
    Stage.CUT: CutSequence._cutting,
    Stage.RETREAT: CutSequence._retreat,
    Stage.SURVEY: lambda sequence, robot, now: sequence._survey.step(robot, now),
}
