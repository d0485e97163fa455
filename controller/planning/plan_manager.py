"""The plan in force: its request, its state, and when points, obstacles or the robot's place void it."""

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from controller.motion.surroundings import obstacles_of
from controller.planning.work_plan import PlannedCut, PlanRequest, WorkPlan, session_plan
from controller.whole_body.obstacle import Axes, Obstacle
from controller.work.point_queue import BOUND, PointQueue, Ticket
from controller.work.posture_search import CutPlan
from controller.work.tries import Made
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import PlanState, SessionPlan
from rolling_panda.messages.types import PointState, Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q
from rolling_panda.model.wire_values import vector3

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
            working: Whether the robot executes the queue, which moves it away from the start of the plan; False when no
                point is left that can be reached.
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
        wanted = not self.valid or self._tried_since() or (working and self._runs_out())
        if not wanted or not due or not accepted or q is None or not (at_rest or working):
            return None
        self._number += 1
        self._asked_at = now
        tries = self._queue.tries.made
        canes = self._queue.canes
        self._asked = PlanRequest(
            self._number, q.copy(), accepted, tuple(obstacles), order, turned, tries, close_up_s, canes
        )
        self._check(why, True)
        return self._asked

    def made_from(self, q: Array) -> bool:
        """Whether the plan holds for a robot at rest at q (12, map), or none can be had."""
        plan = self._plan
        return plan is None or plan.failure is not None or (self.valid and place_changed(plan, q) is None)

    @property
    def cuts(self) -> dict[str, CutPlan] | None:
        """Planned cuts by point id; None while a plan is computed."""
        if self._state == "planning" or (self._state in ("none", "void") and self._queue.next() is not None):
            return None
        return {name: cut.cut for name, cut in self._cuts.items() if not self._tried_since(name)} if self.valid else {}

    def known(self, ticket: Ticket) -> CutPlan | None:
        """The planned cut of an accepted point; None without a valid one."""
        plan, point_id = self._plan, ticket.point.point_id
        if plan is None or ticket.accepted not in plan.request.points:
            return None
        if plan.request.turned != self._queue.approaches.turned:
            return None
        cut = self._cuts.get(point_id)
        return cut.cut if cut is not None and self.valid and not self._tried_since(point_id) else None

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

    def _tried_since(self, *names: str) -> bool:
        """Whether a try of one of these cuts, or of any, has failed since the plan, which holds for the others."""
        made = self._queue.tries.made
        before = made if self._plan is None else self._plan.request.tries
        return tried_since(before, made, names or dict(made)) is not None

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


#: An obstacle is new if no known one was within this distance (m).
OBSTACLE_TOLERANCE = 0.05
#: Tolerances of a robot at rest from the plan's start: base (m), heading and arm joints (rad).
PLACE_TOLERANCE, TURN_TOLERANCE, JOINT_TOLERANCE = 0.05, 0.05, 0.1
#: Largest distance of any point of the robot from the middle of its axle (m).
_REACH = 1.3
#: Range around the tool's line into a cut in which a cane matters (m): half width with camera, and margin.
_BESIDE_TOOL = 0.12
#: Positions along an obstacle's axis that are compared, as fractions of its length.
_SHARES = np.linspace(0.0, 1.0, 9)
#: States set by the work itself. They keep the plan of the other points valid.
_WORKED: frozenset[PointState] = frozenset({"CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN"})


def points_changed(plan: WorkPlan, tickets: Iterable[Ticket], order: tuple[str, ...] = ()) -> Reason | None:
    """How the accepted points and their order differ from the planned ones; None where they do not.

    Args:
        plan: The plan.
        tickets: All of the queue.
        order: That people want them in.
    """
    planned = {point.point_id: point for point in plan.request.points}
    now = {ticket.point.point_id: ticket for ticket in tickets}
    for point_id, ticket in now.items():
        if ticket.state not in BOUND:
            continue
        if point_id not in planned:
            return reasons.accepted_later(point_id)
        if ticket.accepted != planned[point_id]:
            return reasons.accepted_anew(point_id)
    for point_id in planned:
        if point_id not in now or now[point_id].state not in {*BOUND, *_WORKED}:
            return reasons.no_longer_accepted(point_id)
    return None if plan.request.order == order else reasons.order_changed_after()


def approaches_changed(before: tuple[tuple[str, float], ...], now: tuple[tuple[str, float], ...]) -> Reason | None:
    """To which point somebody wants another approach than before; None where to none."""
    for point_id, _ in sorted(set(before) ^ set(now)):
        return reasons.approach_turned_after(point_id)
    return None


def tried_since(before: Made, now: Made, names: Collection[str]) -> Reason | None:
    """Which of these points has had a failed try since; None if none."""
    return next((reasons.approach_turned_after(name) for name, _ in set(now) - set(before) if name in names), None)


def place_changed(plan: WorkPlan, q: Array) -> Reason | None:
    """How far a robot at rest at q (12) is from the plan's start; None within the tolerances."""
    return away_from(plan.request.q, q)


def away_from(start: Array, q: Array) -> Reason | None:
    """How far a robot at rest at q (12) is from another configuration (12); None within the tolerances."""
    away = q - start
    moved, turned = float(np.hypot(*away[:2])), abs(float(away[2]))
    arm = float(np.abs(away[ARM_Q]).max())
    if moved > PLACE_TOLERANCE:
        return reasons.robot_elsewhere(moved)
    if turned > TURN_TOLERANCE:
        return reasons.robot_turned(float(np.degrees(turned)))
    if arm > JOINT_TOLERANCE:
        return reasons.joint_elsewhere(arm)
    return None


class ObstacleWatch:
    """Detects obstacles that the plan did not consider. One instance a plan; a check takes about a millisecond."""

    def __init__(self, before: tuple[Capsule, ...], track: Array, lines: Sequence[tuple[Array, Array]]) -> None:
        """Bind the known obstacles and the motion.

        Args:
            before: Obstacles at the time of the plan.
            track: Positions of the base (n×2, m).
            lines: Line of the tool into each cut: start, end (3 each, m).
        """
        self._before, self._track = before, track
        self._axes = Axes(tuple(obstacles_of(self._before)))
        self._lines = Axes(tuple(Obstacle("", "line", vector3(a), vector3(b), _BESIDE_TOOL) for a, b in lines))

    @classmethod
    def of(cls, plan: WorkPlan) -> "ObstacleWatch":
        """For the session's plan."""
        stands = np.array([cut.cut.q_clear[:2] for cut in plan.cuts]).reshape(-1, 2)
        track = np.vstack([plan.track, stands])
        lines = [(cut.cut.poses.clear.translation, cut.cut.poses.cut.translation) for cut in plan.cuts]
        return cls(plan.request.obstacles, track, lines)

    def changed(self, now: Sequence[Capsule]) -> Reason | None:
        """A new obstacle that affects the plan; None without one.

        Obstacles that disappeared are ignored. So are obstacles out of the robot's reach along the plan, and canes not
        beside the tool's line into a cut.

        Args:
            now: Current obstacles.
        """
        if now is self._before or now == self._before or not now or not len(self._track):
            return None
        start, end = np.array([c.start for c in now]), np.array([c.end for c in now])
        radius = np.array([max(c.start_radius, c.end_radius) for c in now])
        places = (start[:, None] + _SHARES[:, None] * (end - start)[:, None]).reshape(-1, 3)
        new = np.full(len(places), True)
        if self._before:
            # Distance by which each sample extends beyond its nearest known capsule.
            new = self._axes.gaps(places, -np.repeat(radius, len(_SHARES))).min(axis=1) > OBSTACLE_TOLERANCE
        for index in np.flatnonzero(new):
            kind = now[int(index) // len(_SHARES)].kind
            if self._in_the_way(places[index], kind == "cane"):
                return reasons.new_obstacle(kind, *vector3(places[index]))
        return None

    def _in_the_way(self, place: Array, cane: bool) -> bool:
        if cane:
            # The camera sees more canes along the row all the time; only the tool moves among them.
            return float(self._lines.gaps(place[None], np.zeros(1)).min()) < 0.0
        return float(np.hypot(*(place[:2] - self._track).T).min()) < _REACH
