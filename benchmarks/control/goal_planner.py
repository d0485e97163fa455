"""Where to stand and how to hold the arm for a tool pose: sampled places, closed-form postures, the best by cost.

Places around the goal, last joints, headings and, where the rotation about the tool's y is free, that angle come from
one scrambled Sobol sequence, drawn once: the same seed gives the same answer. Every sample is solved in closed form;
what leaves a joint limit falls out; the rest is sorted by travel time with penalties for joint margin and
manipulability; and distances are computed from the best on, until enough are found to be clear.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from benchmarks.control.arm_ik import ArmIk, wrapped
from benchmarks.control.base_path import BasePlanner
from benchmarks.control.path import PathPlanner, Planned, Refused, Stand
from benchmarks.control.plan_limits import PlanLimits
from controller.motion.rest_to_rest import Rates, durations
from controller.whole_body.collision import CollisionModel
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

#: Samples, a power of two for Sobol's sequence: pose given, and with a free rotation to sample as well.
_SAMPLES = {False: 2048, True: 4096}
#: Nearest that the wrist comes to the shoulder (m): the folded elbow's limit.
_NEAREST = 0.25
#: Share of the samples that leave the base where it is.
_STAY = 0.1
_GOOD_MARGIN = 0.35
#: Manipulability of the arm from which on more is worth no time, unless asked for.
GOOD_OMEGA = 0.08
#: Penalties (s) for a posture without any margin or manipulability.
_MARGIN_COST, _OMEGA_COST = 4.0, 4.0
_LEAST_OMEGA = 0.01
#: How many of the best postures have their distances computed, how many of the others at most, in case that all of the
#: best fail for the same reason, and how many clear ones are enough.
_BEST, _OTHERS, _ENOUGH = 150, 300, 8
#: Stands nearer to each other than this, in the largest coordinate (m, rad), count as one.
_SAME = 0.25


@dataclass(frozen=True)
class Stands:
    """Configurations for a goal, best first; where there is none, why, in words."""

    stands: tuple[Stand, ...]
    reason: str


class GoalChooser:
    """Finds stands. Has a robot model's work space through its collision model: one instance a thread."""

    def __init__(self, robot: RobotModel, collision: CollisionModel, limits: PlanLimits, seed: int = 0) -> None:
        """Draw the samples.

        Args:
            robot: Whose arm and base.
            collision: What must be kept clear of.
            limits: Joint limits with margin, rates and clearance.
            seed: Of the samples.
        """
        self._collision, self._limits = collision, limits
        self._ik, self._base = ArmIk(robot), BasePlanner(robot.drive, limits)
        self._samples = {free: qmc.Sobol(5, scramble=True, rng=seed).random(count) for free, count in _SAMPLES.items()}
        self._arm_rates = [
            Rates(float(v), float(a), float(j))
            for v, a, j in zip(limits.arm_velocity, limits.arm_acceleration, limits.arm_jerk, strict=True)
        ]

    def find(
        self,
        q: Array,
        T_odom_tool: Any,
        free_axis: bool = False,
        base_fixed: bool = False,
        good_omega: float = GOOD_OMEGA,
    ) -> Stands:
        """Configurations with the tool at a pose.

        Args:
            q: Configuration (12) at the start.
            T_odom_tool: Goal (pin.SE3).
            free_axis: True where the rotation about the tool's y does not matter.
            base_fixed: True where only the arm may move.
            good_omega: Manipulability from which on more is worth no time.
        """
        found = self._postures(q, T_odom_tool, free_axis, base_fixed, good_omega)
        if isinstance(found, str):
            return Stands((), found)
        clear: list[Stand] = []
        nearest, nearest_pair = -np.inf, ("", "")
        for i in _spread(np.argsort(found.cost)):
            stand = q.copy()
            stand[:3], stand[ARM_Q] = found.base[i], found.arm[i]
            if any(_apart(stand, other.q) < _SAME for other in clear):
                continue
            least = self._collision.least(stand)
            if least.distance > nearest:
                nearest, nearest_pair = least.distance, least.pair
            if least.distance < self._limits.clearance:
                continue
            clear.append(
                Stand(stand, float(found.time[i]), float(found.margin[i]), float(found.omega[i]), least.distance)
            )
            if len(clear) == _ENOUGH:
                break
        if clear:
            return Stands(tuple(clear), "")
        return Stands(
            (),
            f"{len(found.cost)} postures reach it, but each comes nearer than {1e3 * self._limits.clearance:.0f} mm to "
            f"something; the best leaves {1e3 * nearest:.0f} mm between {nearest_pair[0]} and {nearest_pair[1]}",
        )

    def least_time(self, q: Array, T_odom_tool: Any, free_axis: bool = False) -> float | None:
        """The least time (s) in which each actuator alone could be where a sampled posture with the tool there has it.

        From rest to rest at full speed and acceleration, without jerk limit; the base alone drives its straight
        distance and alone turns to its heading. No motion to one of these postures is quicker. None without one.
        """
        found = self._postures(q, T_odom_tool, free_axis, base_fixed=False, good_omega=GOOD_OMEGA)
        if isinstance(found, str):
            return None
        away = found.base[:, :2] - q[:2]
        turn = np.abs((found.base[:, 2] - q[2] + np.pi) % (2.0 * np.pi) - np.pi)
        limits = self._limits
        times = [
            _bang_bang(np.hypot(away[:, 0], away[:, 1]), limits.drive.velocity, limits.drive.acceleration),
            _bang_bang(turn, limits.turn.velocity, limits.turn.acceleration),
            *(
                _bang_bang(np.abs(found.arm[:, i] - q[5 + i]), rates.velocity, rates.acceleration)
                for i, rates in enumerate(self._arm_rates)
            ),
        ]
        return float(np.max(times, axis=0).min())

    def _postures(self, q: Array, goal: Any, free_axis: bool, base_fixed: bool, good_omega: float) -> "_Postures | str":
        """Every sample's postures inside the joint limits, or why there is none."""
        u = self._samples[free_axis]
        n, ik, limits = len(u), self._ik, self._limits
        rotation = (
            _about_y(goal.rotation, 2.0 * np.pi * u[:, 0]) if free_axis else np.broadcast_to(goal.rotation, (n, 3, 3))
        )
        T_flange_tool = ik.tool
        flange_R = rotation @ T_flange_tool.rotation.T
        flange = goal.translation - flange_R @ T_flange_tool.translation
        q7 = limits.lower[6] + (limits.upper[6] - limits.lower[6]) * u[:, 3]
        wrist = ik.wrist(flange_R, flange, q7)
        rise = wrist[:, 2] - ik.shoulder[2]
        if not base_fixed and float(np.abs(rise).min()) > ik.reach:
            return self._too_far(goal, float(np.abs(rise).min()))
        # The ring around the wrist where the shoulder is neither too far from it nor too near.
        most, least = np.maximum(ik.reach**2 - rise**2, 0.0), np.maximum(_NEAREST**2 - rise**2, 0.0)
        radius, angle = np.sqrt(least + (most - least) * u[:, 2]), 2.0 * np.pi * u[:, 1]
        place = wrist[:, :2] + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        stays = np.full(n, True) if base_fixed else u[:, 4] < _STAY
        place[stays] = q[:2]
        # Solved once for a base with heading 0; another heading only turns the first joint.
        at_mount = flange - np.column_stack([place, np.zeros(n)]) - np.array([0.0, 0.0, ik.mount[2]])
        solved = ik.solve(flange_R, at_mount, q7)
        arms, omegas = solved.q.reshape(-1, 7), solved.omega.ravel()
        exists = np.isfinite(arms).all(axis=1)
        if not exists.any():
            apart = np.hypot(rise, np.linalg.norm(wrist[:, :2] - place, axis=1))
            return self._too_far(goal, float(apart.min()))
        inside = exists & (arms[:, 1:] > limits.lower[1:]).all(axis=1) & (arms[:, 1:] < limits.upper[1:]).all(axis=1)
        rows = np.flatnonzero(inside & (omegas > _LEAST_OMEGA))
        base, arm = self._headings(q, place[rows % n], arms[rows], stays[rows % n], u[rows % n, 4], base_fixed)
        omega = np.tile(omegas[rows], len(base) // max(len(rows), 1))
        within = (arm[:, 0] > limits.lower[0]) & (arm[:, 0] < limits.upper[0])
        if not within.any():
            return (
                f"{int(exists.sum())} postures of the arm reach it and every one leaves a joint limit, "
                f"comes too near to one, or is singular"
            )
        base, arm, omega = base[within], arm[within], omega[within]
        margin = ik.margin(arm)
        time = self._time(q, base, arm)
        cost = time + _MARGIN_COST * np.maximum(0.0, 1.0 - margin / _GOOD_MARGIN) ** 2
        cost += _OMEGA_COST * (good_omega / GOOD_OMEGA * np.maximum(0.0, 1.0 - omega / good_omega)) ** 2
        return _Postures(base, arm, omega, margin, time, cost)

    def _headings(
        self, q: Array, place: Array, arm: Array, stays: Array, u: Array, base_fixed: bool
    ) -> tuple[Array, Array]:
        """Each posture with some headings of the base: as it stands, as it arrives both ways, and any."""
        bearing = np.arctan2(place[:, 1] - q[1], place[:, 0] - q[0])
        headings = [np.full(len(place), q[2])]
        if not base_fixed:
            # Where it stays there is no way to arrive by, so these turn the base to where the arm has room.
            arrive = np.where(stays, q[2] + 0.7, bearing)
            headings += [arrive, np.where(stays, q[2] - 0.7, bearing + np.pi), 2.0 * np.pi * u / (1.0 - _STAY)]
        base = np.vstack([np.column_stack([place, heading]) for heading in headings])
        arms = np.tile(arm, (len(headings), 1))
        arms[:, 0] = wrapped(arms[:, 0] - base[:, 2])
        return base, arms

    def _time(self, q: Array, base: Array, arm: Array) -> Array:
        """Time until both base and arm are there (s)."""
        span = np.abs(arm - q[ARM_Q])
        joints = np.stack([durations(span[:, i], rates) for i, rates in enumerate(self._arm_rates)])
        time: Array = np.maximum(joints.max(axis=0), self._base.duration(q[:3], base))
        return time

    def _too_far(self, goal: Any, distance: float) -> str:
        x, y, z = goal.translation
        return (
            f"the goal ({x:.2f}, {y:.2f}, {z:.2f}) m is out of reach: for its direction the wrist would be at least "
            f"{distance:.2f} m from the shoulder, and the arm is {self._ik.reach:.2f} m long; bring it nearer to "
            f"{self._ik.shoulder[2]:.2f} m of height, or free its rotation"
        )


def _spread(order: Any) -> Any:
    """The first of an order, then others at equal distances in it."""
    rest = order[_BEST:]
    return np.concatenate([order[:_BEST], rest[:: max(1, -(-len(rest) // _OTHERS))]])


@dataclass(frozen=True)
class _Postures:
    base: Array
    arm: Array
    omega: Array
    margin: Array
    time: Array
    cost: Array


def _bang_bang(span: Array, velocity: float, acceleration: float) -> Array:
    """Least time (s) over each span from rest to rest."""
    ramp = velocity * velocity / acceleration
    times: Array = np.where(
        span > ramp, span / velocity + velocity / acceleration, 2.0 * np.sqrt(np.minimum(span, ramp) / acceleration)
    )
    return times


def _about_y(R: Array, angle: Array) -> Array:
    """R turned about its own y by each angle (N×3×3)."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = R[:, 0], R[:, 1], R[:, 2]
    return np.stack([c * x - s * z, np.broadcast_to(y, (len(angle), 3)), s * x + c * z], axis=2)


def _apart(a: Array, b: Array) -> float:
    """Largest difference of base pose and arm joints."""
    turned = abs(np.arctan2(np.sin(a[2] - b[2]), np.cos(a[2] - b[2])))
    return max(float(np.abs(a[:2] - b[:2]).max()), float(turned), float(np.abs(a[ARM_Q] - b[ARM_Q]).max()))


class GoalPlanner:
    """Plans motions to tool poses. Uses its robot model's work space: one instance a thread."""

    def __init__(self, robot: RobotModel, collision: CollisionModel, limits: PlanLimits, seed: int = 0) -> None:
        """Bind the parts.

        Args:
            robot: The model that `collision` uses.
            collision: The robot among obstacles; they may be replaced between plans.
            limits: Of planned motions.
            seed: Of all samples.
        """
        self._chooser = GoalChooser(robot, collision, limits, seed)
        self._paths = PathPlanner(robot, collision, limits, seed)

    def least_time(self, q: Array, T_odom_tool: Any, free_axis: bool = False) -> float | None:
        """Lower bound of the time to a goal (s); see `GoalChooser.least_time`."""
        return self._chooser.least_time(q, T_odom_tool, free_axis)

    def plan(
        self,
        q: Array,
        T_odom_tool: Any,
        free_axis: bool = False,
        base_fixed: bool = False,
        together: bool = True,
        good_omega: float = GOOD_OMEGA,
    ) -> Planned | Refused:
        """A motion from rest at a configuration to rest with the tool at a pose.

        Args:
            q: Configuration (12) at the start. It may be outside joint limits or too near to something; the motion then
                leads out of that first.
            T_odom_tool: Goal (pin.SE3).
            free_axis: True where the rotation about the tool's y does not matter.
            base_fixed: True where only the arm may move.
            together: False to drive first, stop, and then reach.
            good_omega: Manipulability at the goal from which on more is worth no time.
        """
        if not (np.isfinite(q).all() and np.isfinite(T_odom_tool.homogeneous).all()):
            return Refused("the start or the goal is not finite; give numbers")
        found = self._chooser.find(q, T_odom_tool, free_axis, base_fixed, good_omega)
        reason = found.reason
        for stand in found.stands:
            planned = self._paths.to_stand(q, stand, together)
            if isinstance(planned, Planned):
                return planned
            reason = (
                f"{len(found.stands)} postures at the goal are clear, but none is reached; the last: {planned.reason}"
            )
        return Refused(reason)
