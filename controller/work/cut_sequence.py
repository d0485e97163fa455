"""The cut sequence: posture search, travel, approach, advance, cut, retreat, next cut.

Between cuts the tool keeps `clearance` from the canes. It moves into them and out of them on one straight line; near
the cut (`arm_only`) the base is at rest. The posture search for the next cut runs while the blades close, so that the
retreat from one cut blends into the motion to the next.
"""

from controller.config import ControllerConfig
from controller.motion.follower import Follower, Measured
from controller.whole_body.saturation import Saturation
from controller.work.approach_segments import ApproachSegments, at_base
from controller.work.blades import Blades
from controller.work.close_up import CloseUpClient
from controller.work.cut_checks import PostCutCheck
from controller.work.next_cut import Known, NextCut, Permit
from controller.work.point_queue import PointQueue
from controller.work.posture_search import CutPlan, PostureSearch
from controller.work.stages import Escape, Parts, Rest, Stage, Surveying
from controller.work.step_result import StepResult
from controller.work.survey import Survey
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.model.differential_drive import Array

#: Largest number of pictures of one close-up.
_PICTURES = 2


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
    ) -> None:
        """Bind the parts.

        `run_id` makes the cut ids of this start unique. `known` gives the planned cut of a point, and
        `permit` the reason why the robot may not approach it.
        """
        close_ups = CloseUpClient(config.work.close_up_timeout_s, _PICTURES)
        check = PostCutCheck(queue, close_ups, config.work.post_cut_check)
        self._parts = Parts(
            config,
            follower,
            saturation,
            queue,
            ApproachSegments(config.work, follower.flows),
            close_ups,
            check,
            Blades(config.work, queue, run_id, check.start),
            NextCut(search, queue, config.search_steps_each, known, permit),
        )
        self._stage: Stage = Rest(self._parts)
        self._places: tuple[Array, ...] = ()

    @property
    def phase(self) -> m.Phase:
        """Phase on the wire."""
        return self._stage.phase

    @property
    def active(self) -> str:
        """Current point of the work; empty without one."""
        return self._stage.point_id

    @property
    def in_canes(self) -> str:
        """Point that the tool hides from the camera now; empty without one."""
        return self._stage.point_id if self._stage.in_canes else ""

    @property
    def plan(self) -> CutPlan | None:
        """Poses and postures of the cut under way; None while there is none."""
        return self._stage.plan

    @property
    def places(self) -> tuple[Array, ...]:
        """Cuts that the motion under way begins or ends at (3, m, odom): the blades may touch the spurs there."""
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

    def start(self, survey: intents.Survey | intents.LookAgain | None = None) -> None:
        """Start with getting the tool clear of the canes, or a survey."""
        parts = self._parts
        # Since a plan was made the robot may have been moved by hand.
        parts.next_cut.forget()
        if survey is None:
            self._stage = Escape(parts)
        else:
            self._stage = Surveying(parts, Survey(parts.config, parts.follower, parts.saturation, parts.queue, survey))

    def finish_cut_and_pause(self, why: m.Reason | None) -> None:
        """With a reason: begin no further cut, leave the canes and pause. None continues the work."""
        self._parts.ending = why

    def abort(self) -> None:
        """Abort the work. A cut in progress is still monitored, and an accepted point stays accepted."""
        self._stage = Rest(self._parts)

    def watch(self, bridge: m.BridgeState, close_up: CloseUpResult | None, now: float) -> tuple[m.Reason, ...]:
        """Process the end of a cut and the newest close-up, in every mode; returns what is logged."""
        parts = self._parts
        if close_up is not None:
            parts.close_ups.update(close_up, now)
        return *parts.blades.watch(bridge, now), *parts.post_cut_check.step(now)

    def picture(self, now: float) -> tuple[int, str] | None:
        """Number and point of the picture to ask for in this period; None when none is due."""
        return self._parts.close_ups.due(now)

    def step(self, robot: Measured, now: float) -> StepResult:
        """One period of work.

        Args:
            robot: Measured robot.
            now: Monotonic time (s).
        """
        self._stage, result = self._stage.step(robot, now)
        if plans := self._stage.plans:
            # While the tool leaves the canes there is no plan; it is still near the last cut.
            self._places = tuple(plan.poses.cut.translation for plan in plans)
        return result
