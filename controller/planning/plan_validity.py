"""Validity of a plan: changes of the points, the obstacles and the robot's position."""

from collections.abc import Iterable, Sequence

import numpy as np

from controller.motion.surroundings import obstacles_of
from controller.planning.work_plan import WorkPlan
from controller.whole_body.obstacle import Axes, Obstacle
from controller.work.point_queue import BOUND, Ticket
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import PointState, Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q
from rolling_panda.model.wire_values import vector3

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
