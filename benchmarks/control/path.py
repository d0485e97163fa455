"""Motions of base and arm from one configuration to another, checked for collisions.

Base and arm move at the same time if that is free of collisions. Otherwise they move one after the other, then with the
arm folded while the base drives, then around the obstacle.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.control.arm_path import ArmPath, ArmPathPlanner, Blocked
from benchmarks.control.base_path import BaseMotion, BasePlanner
from benchmarks.control.plan import Plan, Wait, arm_samples, assemble, orders
from benchmarks.control.plan_limits import PlanLimits
from controller.whole_body.collision import Clearance, CollisionModel
from controller.whole_body.manipulability import arm_omega
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

#: Arm folded over the base for driving among obstacles.
_FOLDED = np.array([0.0, -1.2, 0.0, -2.7, 0.0, 1.9, 0.785])
#: Lateral distance at which the base passes an obstacle (m).
_ROUND = (0.75, 1.1, 1.6)
#: Body of the base: rear, front and half width (m, vendor's mesh).
_OUTLINE = (-0.523, 0.190, 0.290)
#: Number of base motions that are tried between two poses.
_WAYS = 2
#: A start that is too near counts as left without coming nearer if it comes nearer by this at most (m).
_ROUNDING = 0.0002
#: Largest undershoot of the clearance between two checked rows (m).
_BETWEEN = 0.005


@dataclass(frozen=True)
class Stand:
    """A configuration with the tool at the goal.

    Attributes:
        q: Configuration (12); the wheels' entries are those of the start.
        time: Estimated travel time (s).
        margin: Smallest distance to a joint limit (rad).
        omega: Manipulability of the arm.
        clearance: Smallest distance among the robot's parts and to ground and obstacles (m).
    """

    q: Array
    time: float
    margin: float
    omega: float
    clearance: float


@dataclass(frozen=True)
class Planned:
    """A planned motion with its figures.

    Attributes:
        plan: The motion.
        stand: Its end.
        clearance: Smallest distance along it (m) with the two parts. A start that is too near to an obstacle counts
            only after the motion has left it.
    """

    plan: Plan
    stand: Stand
    clearance: Clearance


@dataclass(frozen=True)
class Refused:
    """No plan; `reason` is the reason as text."""

    reason: str


class PathPlanner:
    """Plans motions to configurations. Not thread-safe: it uses the work space of its robot model."""

    def __init__(self, robot: RobotModel, collision: CollisionModel, limits: PlanLimits, seed: int = 0) -> None:
        """Bind the parts.

        Args:
            robot: The model that `collision` uses.
            collision: The robot among obstacles; they may be replaced between plans.
            limits: Of planned motions.
            seed: Of everything that is sampled.
        """
        self._robot, self._collision, self._limits = robot, collision, limits
        self._base, self._arm = BasePlanner(robot.drive, limits), ArmPathPlanner(collision, limits, seed)

    def tool(self, q: Array) -> Array:
        """Place of the tool (3, m, odom) at a configuration (12)."""
        place: Array = self._robot.pose(q, self._robot.tool_id).translation.copy()
        return place

    def to_stand(self, q: Array, stand: Stand, together: bool = True) -> Planned | Refused:
        """A motion from rest at a configuration (12) to rest at a stand."""
        reason = ""
        # The arm spends the time of the drive in the better of its two postures.
        late = arm_omega(self._robot.kinematics(q).J) > stand.omega
        for base, arm, wait in self._candidates(q, stand.q, together, late):
            if isinstance(arm, Blocked):
                reason = reason or arm.reason
                continue
            plan = assemble(self._robot, q, base, arm, self._limits, wait)
            least = self._first_contact(plan)
            if least is None:
                return Planned(plan, stand, self._least(plan))
            reason = (
                f"on the way {least.pair[0]} comes within {1e3 * least.distance:.0f} mm of {least.pair[1]}, "
                f"{1e3 * self._limits.clearance:.0f} mm are kept"
            )
        return Refused(reason)

    def _candidates(
        self, q: Array, goal: Array, together: bool, late: bool
    ) -> Iterator[tuple[BaseMotion, Array | Blocked, Wait]]:
        """Base motion, arm samples and order, the quickest kinds first."""
        directs = self._base.motions(q[:3], goal[:3])[:_WAYS]
        there = self._timed(np.concatenate([goal[:5], q[ARM_Q]]), goal[ARM_Q])
        if isinstance(there, Blocked):
            yield directs[0], there, Wait()
        else:
            for wait in list(orders(directs[0], there, late))[0 if together else 1 : 3 if together else 2]:
                yield directs[0], there, wait
        if not self._collision.obstacles:
            return
        folded = _FOLDED.copy()
        folded[0] = np.clip(q[5], -1.5, 1.5)
        fold, unfold = self._timed(q, folded), self._timed(np.concatenate([goal[:5], folded]), goal[ARM_Q])
        for base in [*directs, *self._round(q[:3], goal[:3])]:
            if self._runs_into(base):
                continue
            if isinstance(fold, Blocked) or isinstance(unfold, Blocked):
                yield base, fold if isinstance(fold, Blocked) else unfold, Wait()
                return
            rows = [fold, np.broadcast_to(folded, (len(base.wheels), 7)), unfold[1:]]
            yield base, np.vstack(rows), Wait(base=len(fold) - 1)

    def _timed(self, q: Array, arm: Array) -> Array | Blocked:
        found = self._arm.find(q, arm)
        return arm_samples(found, self._limits) if isinstance(found, ArmPath) else found

    def _round(self, start: Array, goal: Array) -> Iterator[BaseMotion]:
        """Paths that leave the straight line to either side, in its middle and beside obstacles."""
        line = goal[:2] - start[:2]
        length = float(np.hypot(*line))
        if length < 1e-6:
            return
        along = line / length
        aside = np.array([-along[1], along[0]])
        heading = float(np.arctan2(along[1], along[0]))
        fractions = {0.5} | {
            round(float(np.clip((np.array(o.start[:2]) - start[:2]) @ along / length, 0.1, 0.9)), 1)
            for o in self._collision.obstacles
            if abs(float((np.array(o.start[:2]) - start[:2]) @ aside)) < 1.0
        }
        for far in _ROUND:
            for side in (far, -far):
                for fraction in sorted(fractions, key=lambda s: abs(s - 0.5))[:3]:
                    point = start[:2] + fraction * line + side * aside
                    yield self._base.via([start, np.array([*point, heading]), goal])

    def _runs_into(self, base: BaseMotion) -> bool:
        """Whether the outline of the base covers the foot of an obstacle. A cheap check that ignores what is above."""
        feet = [(*min(o.start, o.end, key=lambda end: end[2])[:2], o.radius) for o in self._collision.obstacles]
        x, y, radius = np.array(feet).T
        poses = base.poses[::5, :, None]
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        ahead = c * (x - poses[:, 0]) + s * (y - poses[:, 1])
        left = -s * (x - poses[:, 0]) + c * (y - poses[:, 1])
        over = (ahead > _OUTLINE[0] - radius) & (ahead < _OUTLINE[1] + radius) & (np.abs(left) < _OUTLINE[2] + radius)
        low = np.array([min(o.start[2], o.end[2]) for o in self._collision.obstacles]) < 0.3
        return bool((over & low).any())

    def _first_contact(self, plan: Plan) -> Clearance | None:
        """First row of the motion that is too near to an obstacle; None without one. Skips rows that cannot collide.

        A start that is too near comes no nearer while it leaves.
        """
        travel, row, last = plan.travel(), 0, len(plan.t) - 1
        needed = self._limits.clearance - _BETWEEN
        been_clear = False
        start = self._collision.least(plan.q[0]).distance
        while True:
            least = self._collision.least(plan.q[row])
            been_clear = been_clear or least.distance >= needed
            if least.distance < (needed if been_clear else min(needed, start - _ROUNDING)):
                return least
            if row == last:
                return None
            row = min(last, travel.next_row(row, least.distance - needed))

    def _least(self, plan: Plan) -> Clearance:
        """Smallest distance of a checked plan, accurate to a few millimetres."""
        travel, row, last = plan.travel(), 0, len(plan.t) - 1
        needed = self._limits.clearance - _BETWEEN
        least: Clearance | None = None
        while row < last:
            here = self._collision.least(plan.q[row])
            if least is None and here.distance < needed:
                row = travel.next_row(row, needed - here.distance)
                continue
            # Rows that cannot be lower than the minimum so far by more than _BETWEEN are skipped.
            least = here if least is None else min(least, here, key=lambda clearance: clearance.distance)
            row = travel.next_row(row, here.distance - least.distance + _BETWEEN)
        end = self._collision.least(plan.q[last])
        return end if least is None else min(least, end, key=lambda clearance: clearance.distance)
