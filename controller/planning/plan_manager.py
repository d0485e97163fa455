"""Requests, validity and state of the plan."""

from collections.abc import Sequence

import numpy as np

from controller.planning.plan_validity import ObstacleWatch, approaches_changed, place_changed, points_changed
from controller.planning.work_plan import PlannedCut, PlanRequest, WorkPlan, session_plan
from controller.work.point_queue import PointQueue, Ticket
from controller.work.posture_search import CutPlan
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import PlanState, SessionPlan
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array

#: Debounce (s): a plan is requested when nothing has changed for this long, as operators accept points in series.
_SETTLED_S = 0.3
#: Shortest time between two requests (s): during work the camera sees more of the row all the time.
_PAUSE_S = 2.0
#: Shortest time after a failure (s).
_AGAIN_S = 10.0
#: Number of next cuts that are rolled out at all times of the work.
_NEXT = 5


class PlanManager:
    """Manages one plan. Call `review` regularly; in between `known` answers for single points."""

    def __init__(self, queue: PointQueue) -> None:
        """Begin without a plan."""
        self._queue = queue
        self._plan: WorkPlan | None = None
        self._cuts: dict[str, PlannedCut] = {}
        self._state: PlanState = "none"
        self._reason: Reason | None = reasons.none_accepted()
        self._asked: PlanRequest | None = None
        self._number = 0
        self._quiet_since = self._asked_at = -np.inf
        self._wanted: tuple[object, ...] = ()
        self._fresh = True
        self._watch = ObstacleWatch((), np.empty((0, 2)), ())
        self._compared: object = None
        self._in_the_way: Reason | None = None

    @property
    def valid(self) -> bool:
        """Whether work follows the plan."""
        return self._state == "valid"

    def review(
        self,
        made: WorkPlan | None,
        q: Array | None,
        obstacles: Sequence[Capsule],
        at_rest: bool,
        working: bool,
        now: float,
        busy: str = "",
        close_up_s: float = 0.5,
    ) -> PlanRequest | None:
        """Accept a new plan, check the current one, and request another if needed.

        Args:
            made: Newest result of the planner; the same object until the next one.
            q: Configuration (12) now, None before the first measurement.
            obstacles: Current obstacles.
            at_rest: Whether the robot is at rest.
            working: Whether the robot executes the queue, which moves it away from the start of the plan.
            now: Monotonic time (s).
            busy: Current point of the work; empty without one.
            close_up_s: Time from the request of the last close-up to its result (s).

        Returns:
            The next request; None without one.
        """
        if made is not None and self._asked is not None and made.request.number == self._asked.number:
            self._accept(made)
        accepted, order, turned = self._queue.accepted(), self._queue.order.by_hand, self._queue.approaches.turned
        if (accepted, order, turned) != self._wanted:
            self._wanted, self._quiet_since = (accepted, order, turned), now
        why = self._why_void(q, obstacles, at_rest, working)
        self._check(why, bool(accepted))
        if self.valid and self._plan is not None:
            self._queue.reach(self._plan.request.points, self._plan.refused, busy)
        pause = _AGAIN_S if self._plan is not None and self._plan.failure else _PAUSE_S
        due = self._asked is None and now - self._quiet_since >= _SETTLED_S and now - self._asked_at >= pause
        wanted = not self.valid or (working and self._runs_out())
        if not wanted or not due or not accepted or q is None or not (at_rest or working):
            return None
        self._number += 1
        self._asked_at = now
        self._asked = PlanRequest(self._number, q.copy(), accepted, tuple(obstacles), order, turned, close_up_s)
        self._check(why, True)
        return self._asked

    @property
    def cuts(self) -> dict[str, CutPlan] | None:
        """Planned cuts by point id; None while a plan is computed."""
        if self._state == "planning" or (self._state in ("none", "void") and self._queue.next() is not None):
            return None
        return {name: cut.cut for name, cut in self._cuts.items()} if self.valid else {}

    def known(self, ticket: Ticket) -> CutPlan | None:
        """The planned cut of an accepted point; None without a valid one."""
        plan, point_id = self._plan, ticket.point.point_id
        if plan is None or ticket.accepted not in plan.request.points:
            return None
        if plan.request.turned != self._queue.approaches.turned:
            return None
        cut = self._cuts.get(point_id)
        return cut.cut if cut is not None and self.valid else None

    def message(self, now: float) -> SessionPlan | None:
        """The message of the plan after a change."""
        if not self._fresh:
            return None
        self._fresh = False
        return session_plan(None if self._state == "none" else self._plan, self._state, self._reason, now)

    def _accept(self, made: WorkPlan) -> None:
        self._asked, self._plan = None, made
        self._cuts = {cut.point.point_id: cut for cut in made.cuts}
        self._watch, self._compared = ObstacleWatch.of(made), None
        self._fresh = True
        self._arrange()

    def _runs_out(self) -> bool:
        """Whether one of the next cuts of the work is not rolled out yet."""
        left = [cut for name, cut in self._cuts.items() if (at := self._queue.get(name)) and at.state == "ACCEPTED"]
        return any(cut.rollout is None for cut in left[:_NEXT])

    def _why_void(self, q: Array | None, obstacles: Sequence[Capsule], at_rest: bool, working: bool) -> Reason | None:
        plan = self._plan
        if plan is None:
            return None
        if plan.failure is not None:
            return reasons.planning_failed(plan.failure)
        why = points_changed(plan, self._queue.tickets(), self._queue.order.by_hand)
        why = why or approaches_changed(plan.request.turned, self._queue.approaches.turned)
        if not why:
            if self._compared is not obstacles:
                self._compared = obstacles
                self._in_the_way = self._watch.changed(obstacles)
            why = self._in_the_way
        if at_rest and not working and q is not None:
            why = why or place_changed(plan, q)
        return why

    def _check(self, why: Reason | None, work: bool) -> None:
        if not work and self._asked is None:
            self._set_state("none", reasons.none_accepted())
        elif self._plan is not None and why is None:
            self._set_state("valid", None)
        elif self._asked is not None:
            self._set_state("planning", why or reasons.first_plan())
        else:
            self._set_state("none" if self._plan is None else "void", why or reasons.plan_awaited())

    def _set_state(self, state: PlanState, reason: Reason | None) -> None:
        if (state, reason) == (self._state, self._reason):
            return
        self._state, self._reason, self._fresh = state, reason, True
        self._arrange()

    def _arrange(self) -> None:
        """Put the queue in the order of a valid plan."""
        plan = self._plan
        if self.valid and plan is not None:
            self._queue.arrange(tuple(cut.point.point_id for cut in plan.cuts))
        else:
            self._queue.arrange(())
