"""Method `hierarchy`: hard limits, then the tool, then posture; docs/control.md has the equations.

The velocity bounds of one period are feasible by construction (`velocity_bounds.py`). Guards (`guards/`)
add rows with priority over the tool. The tool's task is executed exactly or slowed along its path. All other tasks act
in its null space (`tasks/`). Two quadratic programs solve this (`cascade.py`).
"""

import math
from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.cascade import Answer, Cascade, Problem, given_up
from controller.whole_body.compiled import COUNT, MATRIX, NOTHING, NUMBER, PACKED, VECTOR, compiled
from controller.whole_body.guards.axle import AxleAhead
from controller.whole_body.manipulability import ArmManipulability, Manipulability
from controller.whole_body.task import NOT_FINITE, ActuatorTask, Guard, IkProblem, SecondaryTask, Solution
from controller.whole_body.tasks.arm_posture import ArmPosture
from controller.whole_body.tasks.base_reference import BaseReference
from controller.whole_body.tasks.joint_centre import JointCentre
from controller.whole_body.tasks.manipulability import ClimbManipulability
from controller.whole_body.tasks.smoothness import Smoothness
from controller.whole_body.velocity_bounds import Bounds, VelocityBounds
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_XI, RobotModel

#: Rate of the clock below which it counts as stopped, and below which what slows it is told.
_HELD, _SLOW = 1e-2, 5e-2
#: Scale below which motion by hand reports the limiting constraint.
_MISSED = 0.5
#: Unit velocities of the tool for the damping (m/s, rad/s), independent of the planned speed.
_SPEED, _TURN = 0.3, 0.8
_NOWHERE = Manipulability(0.0, np.zeros(NXI))
_ALL, _ARM = slice(0, NXI), ARM_XI
_BOUND_NAMES = ("the base's speed", "the base's turning", *(f"joint {i}" for i in range(1, 8)))


class _Rows(Struct, frozen=True):
    """Rows over ν: lower ≤ A ν ≤ upper. The last two, without a name, are the wheels'."""

    A: Array
    lower: Array
    upper: Array
    names: tuple[str, ...]


class Hierarchy:
    """Strict priorities with hard inequalities."""

    name = "hierarchy"
    flows = True

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float, guards: Sequence[Guard] = ()) -> None:
        """Bind the parts.

        Args:
            robot: Its model.
            config: Section `[controller.whole_body]`.
            dt: Control period (s).
            guards: Inequalities beside the axle's, for instance of collisions.
        """
        settings = config.hierarchy
        self._actuation = Actuation(robot.drive)
        self._box = VelocityBounds(robot, config, dt)
        self._cascade = Cascade(settings.damping, settings.damping_from)
        self._manipulability = ArmManipulability()
        self._climb = ClimbManipulability(
            settings.manipulability, config.gain_manipulability, settings.good_manipulability
        )
        self.guards: tuple[Guard, ...] = (AxleAhead(settings.axle_ahead, settings.axle_rate), *guards)
        self._nothing = np.zeros(NXI)
        self._rise = settings.clock_rise * dt
        self._weight = np.repeat([1.0 / _SPEED, 1.0 / _TURN], 3)
        self._stack(self.secondary_tasks(robot, config))

    def secondary_tasks(self, robot: RobotModel, config: WholeBodyConfig) -> Sequence[SecondaryTask]:
        """The tasks of the null space; their weights are in `[controller.whole_body.hierarchy]`."""
        weights, speed = config.hierarchy, self._box.speed
        return (
            BaseReference(weights.base_place, weights.base_heading, config.gain_posture, config.gain_heading, speed),
            ArmPosture(weights.arm_posture, config.gain_posture, speed),
            self._climb,
            JointCentre(weights.joint_centre, config.gain_limits, config.limit_zone, robot.limits, speed),
            Smoothness(weights.smoothness, self._actuation, speed),
        )

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        if not problem.finite:
            return self._brake(problem, NOT_FINITE, _NOWHERE)
        bounds = self._box.at(problem.q, problem.sent, problem.sent_before, problem.wheel_cap)
        self._climb.now = manipulability = self._manipulability.at(problem.kinematics.J)
        base = bounds.ramp if problem.held is None else self._actuation.twist @ problem.held
        for task, jacobian, target in self._tasks:
            task.write(problem, jacobian, target)
        rows = self._inequalities(problem, bounds)
        J, wanted, speed_scale = self._tool(problem)
        answer = self._cascade.solve(self._problem(problem, bounds, rows, J, wanted, speed_scale, base))
        if answer is None:
            return self._brake(problem, "limits that contradict each other", manipulability)
        return self._solution(problem, answer, base, bounds, speed_scale, rows.names, manipulability)

    # --- parts of the problem ----------------------------------------------------------------------------------------

    def _stack(self, tasks: Sequence[SecondaryTask]) -> None:
        """Give every task its place in one stack of rows."""
        total = sum(task.rows for task in tasks)
        self._T, self._t = np.zeros((total, NXI)), np.zeros(total)
        places = []
        at = 0
        for task in tasks:
            rows = slice(at, at + task.rows)
            task.prepare(self._T[rows])
            places.append((task, self._T[rows], self._t[rows]))
            at += task.rows
        self._tasks = tuple(places)

    def _tool(self, problem: IkProblem) -> tuple[Array, Array, float]:
        """Jacobian J over ν, target of J ν within the speed cap, and the speed scale 0…1 that the cap causes.

        Weighted by the limits of the tool or of the actuators themselves.
        """
        if isinstance(problem.tool, ActuatorTask):
            # The base's velocity is given. Its rows would only outnumber the arm's joints.
            wanted = _ARM if problem.arm_only else _ALL
            weights = np.diag(1.0 / self._box.speed)[wanted]
            return weights, weights @ self._actuation.nu(problem.tool.xi), 1.0
        m = 5 if problem.tool.free_axis else 6
        J, b = np.empty((m, NXI)), np.empty(m)
        R = problem.kinematics.T_odom_tool.rotation
        speed_scale = tool_rows(
            problem.kinematics.J_xi,
            R,
            problem.tool.twist,
            problem.speed_cap,
            self._actuation.wheels,
            self._weight,
            J,
            b,
        )
        return J, b, speed_scale

    def _inequalities(self, problem: IkProblem, bounds: Bounds) -> _Rows:
        """Rows of the guards, then those of the wheels, over ν."""
        found = [rows for guard in self.guards if (rows := guard.rows(problem)).names]
        names = sum((rows.names for rows in found), ())
        k = len(names)
        A, lower, upper = np.empty((k + 2, NXI)), np.empty(k + 2), np.empty(k + 2)
        at = 0
        for rows in found:
            at = guard_rows(rows.A, rows.lower, self._actuation.wheels, at, A, lower, upper)
        wheel_rows(self._actuation.wheels, bounds.wheel_lower, bounds.wheel_upper, at, A, lower, upper)
        return _Rows(A, lower, upper, names)

    def _problem(
        self, problem: IkProblem, bounds: Bounds, rows: _Rows, J: Array, b: Array, speed_scale: float, base: Array
    ) -> Problem:
        keep_path, speed, k = problem.tool.keep_path, self._box.speed, len(rows.names)
        rise = min(1.0, (max(problem.scale, 0.0) + self._rise) / speed_scale) if speed_scale > 0.0 else 1.0
        T, t, A, low, high = self._T, self._t, rows.A, rows.lower, rows.upper
        c = self._nothing[: len(b)]
        if not problem.arm_only:
            sent = self._actuation.nu(problem.sent)
            return Problem(J, b, c, speed, sent, bounds.lower, bounds.upper, A, low, high, k, T, t, rise, keep_path)
        # The arm compensates the base's motion; the wheels' rows do not apply then.
        A, low, high = A[:k], low[:k], high[:k]
        if base[0] != 0.0 or base[1] != 0.0:
            c, t, low = without_base(J, base, c), without_base(T, base, t), without_base(A, base, low)
        J, T, A = J[:, ARM_XI], T[:, ARM_XI], A[:, ARM_XI]
        lower, upper = bounds.lower[ARM_XI], bounds.upper[ARM_XI]
        sent, speed = problem.sent[ARM_XI], speed[ARM_XI]
        return Problem(J, b, c, speed, sent, lower, upper, A, low, high, k, T, t, rise, keep_path)

    # --- the answer --------------------------------------------------------------------------------------------------

    def _solution(
        self,
        problem: IkProblem,
        answer: Answer,
        base: Array,
        bounds: Bounds,
        speed_scale: float,
        names: tuple[str, ...],
        manipulability: Manipulability,
    ) -> Solution:
        free = ARM_XI if problem.arm_only else _ALL
        xi = np.empty(NXI)
        sendable(answer.nu, base, self._actuation.wheels, bounds.wheel_lower, bounds.wheel_upper, xi)
        if problem.held is not None:
            xi[:2] = problem.sent[:2]
        scale = answer.scale * speed_scale
        worst = given_up(answer.slack)
        if worst >= 0:
            return Solution(xi, scale, manipulability.value, False, names[worst])
        held = problem.tool.keep_path and answer.scale < _HELD
        slow = problem.tool.keep_path and answer.scale < _SLOW and answer.holds >= 0
        if held or slow or (answer.missing > _MISSED and answer.holds >= 0):
            what = _holder(answer.holds, free, names)
            # Sliding along a constraint is a valid solution of motion by hand; it is only reported.
            return Solution(xi, scale, manipulability.value, not held, what)
        return Solution(xi, scale, manipulability.value)

    def _brake(self, problem: IkProblem, reason: str, manipulability: Manipulability) -> Solution:
        """The strongest braking of every actuator; from a velocity that is not a number, rest."""
        sent, before = problem.sent, problem.sent_before
        if not math.isfinite(float(sent.sum() + before.sum())):
            return Solution(np.zeros(NXI), 0.0, manipulability.value, False, reason)
        return Solution(self._box.brake(sent, before), 0.0, manipulability.value, False, reason)


def _holder(index: int, free: slice, names: tuple[str, ...]) -> str:
    bounds = _BOUND_NAMES[free]
    if 0 <= index < len(bounds):
        return bounds[index]
    row = index - len(bounds)
    return names[row] if 0 <= row < len(names) else "a limit of the wheels"


@compiled(NUMBER(MATRIX, MATRIX, VECTOR, NUMBER, PACKED, VECTOR, PACKED, VECTOR))
def tool_rows(
    J_xi: Array, R: Array, twist: Array, speed_cap: float, wheels: Array, weight: Array, J: Array, b: Array
) -> float:
    """Write J (m×9) and b (m) of the tool's task; m = 5 leaves the rotation about the tool's y free.

    Args:
        J_xi: Jacobian over ξ̇ (6×9).
        R: Rotation of the tool, R_odom_tool (3×3).
        twist: Desired twist (6).
        speed_cap: Largest speed of the tool's origin (m/s); b is for the twist slowed to it.
        wheels: Wheel speeds of [v, φ̇].
        weight: Weights of the rows (6).
        J: Written.
        b: Written.

    Returns:
        Speed scale 0…1 of the twist that keeps the speed cap.
    """
    m = len(b)
    speed = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
    speed_scale = max(speed_cap, 0.0) / speed if speed > speed_cap else 1.0
    for row in range(m):
        for j in range(9):
            J[row, j] = 0.0
        b[row] = 0.0
        # About the tool's own x and z where its y is free, about odom's axes otherwise.
        axis = 2 * (row - 3)
        for i in range(6):
            along = 1.0 if i == row else 0.0
            if m == 5 and row >= 3:
                along = R[i - 3, axis] if i >= 3 else 0.0
            if along != 0.0:
                along *= weight[row]
                b[row] += along * speed_scale * twist[i]
                for j in range(2):
                    J[row, j] += along * (J_xi[i, 0] * wheels[0, j] + J_xi[i, 1] * wheels[1, j])
                for j in range(2, 9):
                    J[row, j] += along * J_xi[i, j]
    return speed_scale


@compiled(COUNT(MATRIX, VECTOR, PACKED, COUNT, PACKED, VECTOR, VECTOR))
def guard_rows(A_xi: Array, least: Array, wheels: Array, at: int, A: Array, lower: Array, upper: Array) -> int:
    """Write rows A_xi ξ̇ ≥ least (k×9, k) into A, lower and upper from row `at` on; returns the row after them."""
    for i in range(len(least)):
        for j in range(2):
            A[at, j] = A_xi[i, 0] * wheels[0, j] + A_xi[i, 1] * wheels[1, j]
        for j in range(2, 9):
            A[at, j] = A_xi[i, j]
        lower[at], upper[at] = least[i], math.inf
        at += 1
    return at


@compiled(NOTHING(PACKED, VECTOR, VECTOR, COUNT, PACKED, VECTOR, VECTOR))
def wheel_rows(wheels: Array, least: Array, most: Array, at: int, A: Array, lower: Array, upper: Array) -> None:
    """Write the bounds of the wheels' speeds (2) into A, lower and upper from row `at` on."""
    for i in range(2):
        for j in range(9):
            A[at + i, j] = wheels[i, j] if j < 2 else 0.0
        lower[at + i], upper[at + i] = least[i], most[i]


def without_base(rows: Array, base: Array, rest: Array) -> Array:
    """Remainder of `rest` (k) for the arm: rows (k×9, over ν or ξ̇) with the base's part `base` (2) subtracted."""
    left = np.empty(len(rest))
    _without_base(rows, base, rest, left)
    return left


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, VECTOR))
def _without_base(rows: Array, base: Array, rest: Array, left: Array) -> None:
    for i in range(len(rest)):
        left[i] = rest[i] - rows[i, 0] * base[0] - rows[i, 1] * base[1]


@compiled(NOTHING(VECTOR, VECTOR, PACKED, VECTOR, VECTOR, VECTOR))
def sendable(nu: Array, base: Array, wheels: Array, least: Array, most: Array, xi: Array) -> None:
    """Write ξ̇ (9) for ν (9), or for the arm's part of ν (7) with the base's velocity `base` (2).

    The wheel speeds are clipped to their bounds `least` and `most` (2) against rounding.
    """
    fixed = 9 - len(nu)
    v, omega = (base[0], base[1]) if fixed else (nu[0], nu[1])
    for i in range(2):
        xi[i] = min(max(wheels[i, 0] * v + wheels[i, 1] * omega, least[i]), most[i])
    for i in range(2, 9):
        xi[i] = nu[i - fixed]
