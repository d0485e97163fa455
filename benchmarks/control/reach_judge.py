"""What a motion was like, judged from its trajectory alone: errors, limits by finite differences, room, and ω."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.config import HierarchyConfig
from controller.motion.follower import tool_error
from controller.whole_body.collision import CollisionModel, Pair
from controller.whole_body.manipulability import arm_omega
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

#: A goal counts as reached within these (m, rad).
POSITION, ROTATION = 1e-3, np.radians(0.5)
#: What the controller keeps of each pair.
_CONFIG = HierarchyConfig()
#: Rows between two looks at the distances.
_LOOK = 5
#: What finite differences of rounded numbers may be above a limit.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Trajectory:
    """What was done: t (T), q (T×12) and ξ̇ (T×9) from each row to the next, at rest before and after."""

    t: Array
    q: Array
    xi: Array


@dataclass(frozen=True)
class BaseBounds:
    """Speed (m/s) and yaw rate (rad/s) that the base was to keep."""

    speed: float
    yaw_rate: float


@dataclass(frozen=True)
class Violations:
    """How often each kind of limit was broken (rows × joints), and by how much at most.

    Position and velocity in rad and rad/s (the base in m/s and rad/s), acceleration in rad/s².
    """

    position: int
    position_size: float
    velocity: int
    velocity_size: float
    acceleration: int
    acceleration_size: float

    @property
    def total(self) -> int:
        """All kinds together."""
        return self.position + self.velocity + self.acceleration


@dataclass(frozen=True)
class Quality:
    """Judgement of one trajectory.

    Attributes:
        reached: Whether it ends within 1 mm and 0.5° of the goal.
        position_error: At the end (m).
        rotation_error: At the end (rad); with tool_y free, of the direction of the tool's y.
        duration: (s).
        settled: From when on the tool is within 1 mm and 0.5° until the end (s); None where it is not at the end.
        base_travel: (m).
        violations: Of limits.
        rolling: Largest ‖A q̇‖ with q̇ = S ξ̇, and largest difference of q from the exact arcs of the wheels.
        omega_mean: Mean ω of the arm.
        omega_least: Least one.
        margin_least: Least distance to a joint limit (rad).
        clearance_least: Least distance between the robot's parts and from the ground (m), looked at every fifth row.
        clearance_start: The same at the start (m).
        clearance_lost: How far a pair came below what the controller keeps of it, or below its distance at the start
            where that was less (m); negative where each had more.
    """

    reached: bool
    position_error: float
    rotation_error: float
    duration: float
    settled: float | None
    base_travel: float
    violations: Violations
    rolling: float
    omega_mean: float
    omega_least: float
    margin_least: float
    clearance_least: float
    clearance_start: float
    clearance_lost: float


def judge(
    robot: RobotModel, collision: CollisionModel, base: BaseBounds, done: Trajectory, goal: Any, free: bool
) -> Quality:
    """Judge a trajectory against its goal (pin.SE3) and the robot's limits."""
    q, limits = done.q, robot.limits
    error = goal_error(robot.pose(q[-1], robot.tool_id), goal, free)
    position, rotation = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
    omega = [arm_omega(robot.kinematics(row).J) for row in q]
    looked = [*q[::_LOOK], q[-1]]
    margin = np.minimum(q[:, ARM_Q] - limits.lower[ARM_Q], limits.upper[ARM_Q] - q[:, ARM_Q])
    return Quality(
        reached=within(error, POSITION, ROTATION),
        position_error=position,
        rotation_error=rotation,
        duration=float(done.t[-1]),
        settled=_settled(robot, done, goal, free),
        base_travel=float(np.hypot(*np.diff(q[:, :2], axis=0).T).sum()),
        violations=violations(robot, base, done),
        rolling=rolling(robot, done),
        omega_mean=float(np.mean(omega)),
        omega_least=float(np.min(omega)),
        margin_least=float(margin.min()),
        clearance_start=collision.least(q[0]).distance,
        clearance_least=min(collision.least(row).distance for row in looked),
        clearance_lost=_lost(collision, looked),
    )


def _lost(collision: CollisionModel, rows: Sequence[Array]) -> float:
    most = max(_CONFIG.collision_distance, _CONFIG.cane_distance)
    start = _near(collision, rows[0], np.inf)
    lost = -np.inf
    for row in rows:
        for pair, distance in _near(collision, row, most).items():
            lost = max(lost, min(start.get(pair, np.inf), _CONFIG.kept(pair)) - distance)
    return float(lost) if np.isfinite(lost) else -most


def _near(collision: CollisionModel, q: Array, within: float) -> dict[Pair, float]:
    """The least distance of each pair of parts nearer than `within` (m)."""
    found = collision.distances(q, within)
    out: dict[Pair, float] = {}
    for pair, distance in zip(found.pairs, found.distance.tolist(), strict=True):
        out.setdefault(pair, distance)
    return out


def _settled(robot: RobotModel, done: Trajectory, goal: Any, free: bool) -> float | None:
    since = None
    for t, q in zip(reversed(done.t), reversed(done.q), strict=True):
        if not within(goal_error(robot.pose(q, robot.tool_id), goal, free), POSITION, ROTATION):
            break
        since = float(t)
    return since


def within(error: Array, position: float, rotation: float) -> bool:
    """Whether an error (6) is within both (m, rad)."""
    return bool(float(np.linalg.norm(error[:3])) <= position and float(np.linalg.norm(error[3:])) <= rotation)


def goal_error(T_odom_tool: Any, goal: Any, free: bool) -> Array:
    """Error of the tool (6: m, rad); with its y free to be turned about, only y's direction counts."""
    error = tool_error(T_odom_tool, goal)
    error[:3] = goal.translation - T_odom_tool.translation
    if free:
        y, wanted = T_odom_tool.rotation[:, 1], goal.rotation[:, 1]
        error[3:] = 0.0
        error[3] = np.arctan2(float(np.linalg.norm(np.cross(y, wanted))), float(y @ wanted))
    return error


def violations(robot: RobotModel, base: BaseBounds, done: Trajectory) -> Violations:
    """Limits broken, velocity and acceleration recomputed from q by finite differences."""
    limits, dt = robot.limits, np.diff(done.t)[:, None]
    arm = done.q[:, ARM_Q]
    position = np.maximum(limits.lower[ARM_Q] - arm, arm - limits.upper[ARM_Q])
    rates = np.diff(done.q[:, 3:], axis=0) / dt
    v, w = robot.drive.twist(rates[:, 0], rates[:, 1])  # type: ignore[arg-type]
    velocity = np.hstack(
        [np.abs(rates) - limits.velocity, np.abs(v)[:, None] - base.speed, np.abs(w)[:, None] - base.yaw_rate]
    )
    still = np.zeros((1, rates.shape[1]))
    period = float(dt[0, 0]) if len(dt) else 1.0
    acceleration = np.abs(np.diff(np.vstack([still, rates, still]), axis=0)) / period - limits.acceleration
    counts: list[tuple[int, float]] = []
    for excess, slack in ((position, 1e-9), (velocity, _ROUNDING), (acceleration, 10.0 * _ROUNDING)):
        broken = excess > slack
        counts.append((int(broken.sum()), float(excess[broken].max()) if broken.any() else 0.0))
    (p, p_size), (d, d_size), (a, a_size) = counts
    return Violations(p, p_size, d, d_size, a, a_size)


def rolling(robot: RobotModel, done: Trajectory) -> float:
    """How far the wheels' rolling without slip is from kept."""
    worst = 0.0
    for row, after, xi, dt in zip(done.q, done.q[1:], done.xi, np.diff(done.t), strict=False):
        phi = float(row[2])
        slip = robot.drive.constraint(phi) @ (robot.drive.basis(phi) @ xi)
        arc = robot.drive.integrate(row[:3], float(xi[0] * dt), float(xi[1] * dt))
        worst = max(worst, float(np.abs(slip).max()), float(np.abs(after[:3] - arc).max()))
    return worst
