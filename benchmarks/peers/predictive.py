"""Whole-body model predictive control on Crocoddyl with the SQP of mim-solvers, after the idea of Wang et al. (2025).

State: base pose, arm joints, and the velocities ν = [v, φ̇, q̇]; input: their accelerations. Over the horizon the tool's
error to the goal, what the arm's manipulability is short of a good one, velocities and accelerations cost; velocities,
joint positions and accelerations are bounded, as far as one iteration of the solver keeps bounds. Towards the goal
manipulability gives way to the tool. Weights, horizon and the form of the costs are ours. It knows no obstacles. The
model's functions are written in Python, so that its time is not comparable with theirs in C++.

With one goal it goes there in its own way. In rows it follows a motion: each knot wants the tool where the motion has
it then, and base and arm near the motion's posture.
"""

import math
import time
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import ActuatorTask, IkProblem, Solution, ToolTask
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

#: Knots of the horizon, their distance (s), iterations of the solver at each of its turns, and of its QP in each.
_KNOTS, _STEP, _ITERATIONS, _QP_ITERATIONS = 20, 0.1, 1, 200
#: Time from one turn of the solver to the next (s).
_TURN = 0.05
#: Costs of the tool's place and turning at a knot, their factor at the last, and costs of velocities and of
#: accelerations, each as a share of its limit.
_PLACE, _TURNING, _LAST, _SPEED, _EFFORT = 100.0, 30.0, 10.0, 1e-2, 1e-2
#: Cost of what the arm's manipulability is short of a good one, as a share of that one; and the distance of the tool
#: from its goal (m) below which it costs less, down to nothing at the goal, where it would hold the tool off.
_MANIPULABILITY, _GOOD_OMEGA, _NEAR = 3.0, 0.15, 0.3
#: Following a motion: cost of base and arm away from its posture (1/m², 1/rad²), and factor of the tool's costs.
_POSTURE, _FIRM = 0.03, 10.0
#: Factor of the base's speed cost where the base is held.
_HELD = 1e4
#: Entries of the state: base pose and arm joints, then ν.
_POSES, _NX = 10, 10 + NXI


class Predictive:
    """A whole-body method that plans to the goal anew 20 times a second."""

    name = "mpc"
    flows = True

    def __init__(
        self, robot: RobotModel, config: WholeBodyConfig, dt: float, manipulability: float = _MANIPULABILITY
    ) -> None:
        """Build the problem for a control period of `dt` (s); `manipulability` is its cost far from the goal.

        Raises:
            RollingPandaError: Crocoddyl or mim-solvers is not installed.
        """
        try:
            import crocoddyl
            import mim_solvers
        except ImportError as error:
            raise RollingPandaError(
                f"mpc is not installed ({error}); `make peers` installs it, without its dependencies: with them, "
                "Crocoddyl would change the robot's model"
            ) from error
        self._dt, self._actuation = dt, Actuation(robot.drive)
        self._manipulability = ArmManipulability()
        self._solver_of = mim_solvers.SolverCSQP
        self._shooting_of = crocoddyl.ShootingProblem
        #: The action models of the knots, and of the last one.
        self.running = [_model(crocoddyl, RobotModel(), config, manipulability, last=False) for _ in range(_KNOTS)]
        self.last = _model(crocoddyl, RobotModel(), config, manipulability, last=True)
        self._knots = [*self.running, self.last]
        self._greatest = self.last.acceleration
        self._fastest = self.last.velocity
        #: Processor time of each of the solver's turns (s).
        self.seconds: list[float] = []
        self._states: list[Array] = []
        self._inputs: list[Array] = []
        self._since = 0.0

    def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
        """Begin a motion to a tool pose (pin.SE3); see `Aimed`."""
        for model in self._knots:
            model.aim(T_odom_goal, free_axis)
        self.seconds = []
        self._forget()

    def _forget(self) -> None:
        self._states, self._inputs = [], []
        self._since = _TURN

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities of the newest plan; see `Method.solve`. The problem's twist is not used."""
        nu = self._actuation.nu(problem.sent)
        if self._due:
            self._plan(np.concatenate([_pose(problem.q), nu]), problem.kinematics.T_odom_tool.translation)
            self._since = 0.0
        self._since += self._dt
        change = np.clip(self._inputs[0], -self._greatest, self._greatest) * self._dt
        xi = self._actuation.xi(np.clip(nu + change, -self._fastest, self._fastest))
        return Solution(xi, 1.0, self._manipulability.at(problem.kinematics.J).value)

    @property
    def _due(self) -> bool:
        """Whether it plans in this period."""
        return self._since >= _TURN - 0.5 * self._dt

    def _plan(self, x: Array, place: Array) -> None:
        began = time.thread_time()
        solver = self._solver_of(self._shooting_of(x, self.running, self.last))
        solver.termination_tolerance = 1e-4
        solver.max_qp_iters = _QP_ITERATIONS
        if not self._states:
            self._states, self._inputs = [x.copy() for _ in range(_KNOTS + 1)], [np.zeros(NXI) for _ in range(_KNOTS)]
        self._states[0] = x
        distance = float(np.linalg.norm(self.last.goal.translation - place))
        for model in self._knots:
            model.lean(distance)
        solver.solve(self._states, self._inputs, _ITERATIONS)
        found = [np.array(u) for u in solver.us]
        if all(np.isfinite(u).all() for u in found):
            self._states, self._inputs = [np.array(x) for x in solver.xs], found
        else:
            self._states, self._inputs = [x.copy() for _ in range(_KNOTS + 1)], [np.zeros(NXI) for _ in range(_KNOTS)]
        self.seconds.append(time.thread_time() - began)


class Following(Predictive):
    """The same in rows: it follows a motion, within all limits, with a base that may be held."""

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Build the problem for a control period of `dt` (s)."""
        super().__init__(robot, config, dt)
        self._saturation = Saturation(robot, config, dt)
        self._end: Any = None

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities of the newest plan; see `Method.solve`."""
        if isinstance(problem.tool, ActuatorTask):
            self._end = None
            wanted = problem.tool.xi
        else:
            self._follow(problem, problem.tool)
            wanted = super().solve(problem).xi
            if problem.arm_only:
                wanted[:2] = 0.0 if problem.base == "frozen" else problem.sent[:2]
        limited = self._saturation.apply(wanted, problem.q, problem.sent)
        omega = self._manipulability.at(problem.kinematics.J).value
        return Solution(limited.xi, limited.scale, omega, not limited.braked, "a limit" if limited.braked else "")

    def _follow(self, problem: IkProblem, task: ToolTask) -> None:
        """Let each knot aim at where the motion has the tool then, with base and arm near the motion's posture.

        A motion that ends elsewhere is another one, and what was planned for the last is forgotten. The knots are on
        the clock of the motion at full rate; at the rate of a motion that is held they do worse in rows.
        """
        T, ahead = problem.kinematics.T_odom_tool, task.ahead

        def along(seconds: float) -> Any:
            turn = pin.exp3(seconds * task.twist[3:])
            return pin.SE3(turn @ T.rotation, T.translation + seconds * task.twist[:3])

        if ahead is None:
            ahead, self._end = along, None
        elif self._end is None or not ahead(math.inf).isApprox(self._end):
            self._end = ahead(math.inf)
            self._forget()
        if not self._due:
            return
        posture = _pose(problem.posture.q)
        for number, model in enumerate(self._knots):
            model.aim(ahead(number * _STEP), task.free_axis)
            model.stay(posture, problem.arm_only)


def _pose(q: Array) -> Array:
    """Base pose and arm joints (10) of a configuration (12)."""
    return np.concatenate([q[:3], q[ARM_Q]])


def _model(crocoddyl: Any, robot: RobotModel, config: WholeBodyConfig, manipulability: float, last: bool) -> Any:
    """The action model of a knot, of Crocoddyl's type; `manipulability` is what that of the arm costs."""
    limits = robot.limits
    arm_speed = limits.velocity[ARM_XI] * config.arm_velocity_scale
    arm_acceleration = limits.acceleration[ARM_XI] * config.arm_acceleration_scale
    velocity = np.concatenate([[config.base_speed, config.base_yaw_rate], arm_speed])
    acceleration = np.concatenate([[config.base_acceleration, config.base_yaw_acceleration], arm_acceleration])
    bounds = 7 + NXI + (0 if last else NXI)
    speed_cost, effort_cost = _SPEED / velocity**2, _EFFORT / acceleration**2
    # What does not depend on the state: second derivatives, and derivatives of joints, velocities and input.
    Luu = np.diag(effort_cost)
    Gx, Gu = np.zeros((bounds, _NX)), np.zeros((bounds, NXI))
    Gx[:7, 3:_POSES], Gx[7 : 7 + NXI, _POSES:] = np.eye(7), np.eye(NXI)
    if not last:
        Gu[7 + NXI :] = np.eye(NXI)
    pose_columns = [0, 1, 2, *range(5, NQ)]
    arm = ArmManipulability()

    class Knot(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
        """Integration over one step, costs and bounds."""

        def __init__(self) -> None:
            state = crocoddyl.StateVector(_NX)
            super().__init__(state, 0 if last else NXI, 7, bounds, 0)
            self.velocity, self.acceleration = velocity, acceleration
            self.posture, self.pull, self.speed = np.zeros(_POSES), 0.0, speed_cost
            self.aim(pin.SE3.Identity(), False)
            lower = [limits.lower[ARM_Q] + config.joint_margin, -velocity]
            upper = [limits.upper[ARM_Q] - config.joint_margin, velocity]
            if not last:
                lower.append(-acceleration)
                upper.append(acceleration)
            self.g_lb, self.g_ub = np.concatenate(lower), np.concatenate(upper)

        def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
            turning = [_TURNING, 0.0 if free_axis else _TURNING, _TURNING]
            tool = (_LAST if last else _STEP) * np.array([*[_PLACE] * 3, *turning])
            self.goal = T_odom_goal
            self.weights = np.append(tool, 0.0)
            # The pose that was asked for last, and its residuals.
            self.seen = np.full(_POSES, np.nan)
            self.found: tuple[Array, Array] = (np.zeros(7), np.zeros((7, _POSES)))

        def stay(self, posture: Array, base_held: bool) -> None:
            """Keep to a motion: base and arm (10) near its posture, the base at rest where it is held."""
            self.weights[:6] *= _FIRM
            self.posture, self.pull = posture, _POSTURE
            self.speed = speed_cost.copy()
            if base_held:
                self.speed[:2] *= _HELD

        def lean(self, distance: float) -> None:
            """Weigh manipulability for a tool so far from its goal (m)."""
            self.weights[6] = (1.0 if last else _STEP) * manipulability * min(1.0, distance / _NEAR)

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            r, _ = self._residuals(x)
            nu = x[_POSES:]
            away = x[:_POSES] - self.posture
            data.cost = 0.5 * float(self.weights @ (r * r) + self.speed @ (nu * nu) + self.pull * away @ away)
            if u is None or last:
                data.xnext = x
                data.g = x[3:]
                return
            data.cost += 0.5 * float(effort_cost @ (u * u))
            after = nu + _STEP * u
            # The pose of the base in the middle of the step has the direction of its chord.
            heading, v = x[2] + 0.5 * _STEP * after[1], after[0]
            xnext = np.concatenate([x[:_POSES], after])
            xnext[0] += _STEP * v * np.cos(heading)
            xnext[1] += _STEP * v * np.sin(heading)
            xnext[2:_POSES] += _STEP * after[1:]
            data.xnext = xnext
            data.g = np.concatenate([x[3:], u])

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            r, J = self._residuals(x)
            nu = x[_POSES:]
            weighted = J.T * self.weights
            second = np.diag(np.concatenate([np.full(_POSES, self.pull), self.speed]))
            second[:_POSES, :_POSES] += weighted @ J
            away = self.pull * (x[:_POSES] - self.posture)
            data.Lx, data.Lxx = np.concatenate([weighted @ r + away, self.speed * nu]), second
            data.Gx = Gx
            if u is None or last:
                return
            after = nu + _STEP * u
            heading = x[2] + 0.5 * _STEP * after[1]
            c, s, v = np.cos(heading), np.sin(heading), after[0]
            # The next pose over the heading now, and over ν after the step.
            over = np.zeros((_POSES, NXI))
            over[0, :2] = c, -0.5 * _STEP * v * s
            over[1, :2] = s, 0.5 * _STEP * v * c
            over[range(2, _POSES), range(1, NXI)] = 1.0
            Fx, Fu = np.eye(_NX), np.zeros((_NX, NXI))
            Fx[0, 2], Fx[1, 2] = -_STEP * v * s, _STEP * v * c
            Fx[:_POSES, _POSES:] = _STEP * over
            Fu[:_POSES], Fu[_POSES:] = _STEP**2 * over, _STEP * np.eye(NXI)
            data.Fx, data.Fu = Fx, Fu
            data.Lu, data.Luu, data.Gu = effort_cost * u, Luu, Gu

        def _residuals(self, x: Array) -> tuple[Array, Array]:
            """The residuals (7) and their derivatives over base pose and arm (7×10).

            Six are the tool's error in its own frame. The last is what the arm's manipulability is short of a good one,
            1 − ω/ω_good, whose derivative is exact. The solver asks for each state several times in a row.
            """
            if np.array_equal(x[:_POSES], self.seen):
                return self.found
            q = np.zeros(NQ)
            q[:3], q[ARM_Q] = x[:3], x[3:_POSES]
            pin.computeJointJacobians(robot.model, robot.data, q)
            T = self.goal.actInv(pin.updateFramePlacement(robot.model, robot.data, robot.tool_id))
            J = pin.getFrameJacobian(robot.model, robot.data, robot.tool_id, pin.LOCAL)
            omega = arm.at(J)
            r, over = np.empty(7), np.zeros((7, _POSES))
            r[:6], r[6] = pin.log6(T).vector, 1.0 - omega.value / _GOOD_OMEGA
            over[:6], over[6, 3:] = pin.Jlog6(T) @ J[:, pose_columns], omega.gradient[ARM_XI] / -_GOOD_OMEGA
            self.seen, self.found = x[:_POSES].copy(), (r, over)
            return self.found

    return Knot()
