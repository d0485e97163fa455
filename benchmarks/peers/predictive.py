"""Whole-body model predictive control on Crocoddyl with the constrained SQP of mim-solvers, as Wang et al. (2025) do.

State: base pose, arm joints, and the velocities ν = [v, φ̇, q̇]; input: their accelerations. Over the horizon the tool's
error to the goal, velocities and accelerations cost; velocities, joint positions and accelerations are bounded. It
knows no obstacles. The model's functions are written in Python, so that its time is not comparable with theirs in C++.
"""

import time
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.task import IkProblem, Solution
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

#: Knots of the horizon, their distance (s), and iterations of the solver at each of its turns.
_KNOTS, _STEP, _ITERATIONS = 20, 0.1, 3
#: Time from one turn of the solver to the next (s).
_TURN = 0.05
#: Costs of the tool's place and turning at a knot, their factor at the last, and costs of velocities and of
#: accelerations, each as a share of its limit.
_PLACE, _TURNING, _LAST, _SPEED, _EFFORT = 100.0, 30.0, 10.0, 1e-2, 1e-2
#: Entries of the state: base pose and arm joints, then ν.
_POSES, _NX = 10, 10 + NXI


class Predictive:
    """A whole-body method that plans to the goal anew 20 times a second."""

    name = "mpc"
    flows = True

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Build the problem for a control period of `dt` (s).

        Raises:
            RollingPandaError: Crocoddyl or mim-solvers is not installed.
        """
        try:
            import crocoddyl
            import mim_solvers
        except ImportError as error:
            raise RollingPandaError(
                f"mpc is not installed ({error}); it needs `pip install --no-deps crocoddyl libcrocoddyl mim-solvers "
                "libmim-solvers`: with its dependencies, Crocoddyl would change the robot's model"
            ) from error
        self._dt, self._actuation = dt, Actuation(robot.drive)
        self._manipulability = ArmManipulability()
        self._solver_of = mim_solvers.SolverCSQP
        self._shooting_of = crocoddyl.ShootingProblem
        self._running = [_model(crocoddyl, RobotModel(), config, last=False) for _ in range(_KNOTS)]
        self._last = _model(crocoddyl, RobotModel(), config, last=True)
        self._greatest = self._last.acceleration
        self._fastest = self._last.velocity
        #: Processor time of each of the solver's turns (s).
        self.seconds: list[float] = []
        self._states: list[Array] = []
        self._inputs: list[Array] = []
        self._since = 0.0

    def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
        """Begin a motion to a tool pose (pin.SE3); see `Aimed`."""
        for model in (*self._running, self._last):
            model.aim(T_odom_goal, free_axis)
        self._states, self._inputs, self.seconds = [], [], []
        self._since = _TURN

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities of the newest plan; see `Method.solve`. The problem's twist is not used."""
        nu = self._actuation.nu(problem.sent)
        if self._since >= _TURN - 0.5 * self._dt:
            self._plan(np.concatenate([problem.q[:3], problem.q[ARM_Q], nu]))
            self._since = 0.0
        self._since += self._dt
        change = np.clip(self._inputs[0], -self._greatest, self._greatest) * self._dt
        xi = self._actuation.xi(np.clip(nu + change, -self._fastest, self._fastest))
        return Solution(xi, 1.0, self._manipulability.at(problem.kinematics.J).value)

    def _plan(self, x: Array) -> None:
        began = time.thread_time()
        solver = self._solver_of(self._shooting_of(x, self._running, self._last))
        solver.termination_tolerance = 1e-4
        solver.max_qp_iters = 50
        if not self._states:
            self._states, self._inputs = [x.copy() for _ in range(_KNOTS + 1)], [np.zeros(NXI) for _ in range(_KNOTS)]
        self._states[0] = x
        solver.solve(self._states, self._inputs, _ITERATIONS)
        found = [np.array(u) for u in solver.us]
        if all(np.isfinite(u).all() for u in found):
            self._states, self._inputs = [np.array(x) for x in solver.xs], found
        else:
            self._states, self._inputs = [x.copy() for _ in range(_KNOTS + 1)], [np.zeros(NXI) for _ in range(_KNOTS)]
        self.seconds.append(time.thread_time() - began)


def _model(crocoddyl: Any, robot: RobotModel, config: WholeBodyConfig, last: bool) -> Any:
    """The action model of a knot, of Crocoddyl's type."""
    limits = robot.limits
    arm_speed = limits.velocity[ARM_XI] * config.arm_velocity_scale
    arm_acceleration = limits.acceleration[ARM_XI] * config.arm_acceleration_scale
    velocity = np.concatenate([[config.base_speed, config.base_yaw_rate], arm_speed])
    acceleration = np.concatenate([[config.base_acceleration, config.base_yaw_acceleration], arm_acceleration])
    bounds = 7 + NXI + (0 if last else NXI)

    class Knot(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
        """Integration over one step, costs and bounds."""

        def __init__(self) -> None:
            state = crocoddyl.StateVector(_NX)
            super().__init__(state, 0 if last else NXI, 6, bounds, 0)
            self.velocity, self.acceleration = velocity, acceleration
            self.goal, self.free = pin.SE3.Identity(), False
            lower = [limits.lower[ARM_Q] + config.joint_margin, -velocity]
            upper = [limits.upper[ARM_Q] - config.joint_margin, velocity]
            if not last:
                lower.append(-acceleration)
                upper.append(acceleration)
            self.g_lb, self.g_ub = np.concatenate(lower), np.concatenate(upper)

        def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
            self.goal, self.free = T_odom_goal, free_axis

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            weights, r, _ = self._error(x, False)
            nu = x[_POSES:]
            data.cost = 0.5 * float(weights @ r**2) + 0.5 * _SPEED * float(((nu / velocity) ** 2).sum())
            if u is None or last:
                data.xnext = x
                data.g = np.concatenate([x[3:_POSES], nu])
                return
            data.cost += 0.5 * _EFFORT * float(((u / acceleration) ** 2).sum())
            after = nu + _STEP * u
            # The pose of the base in the middle of the step has the direction of its chord.
            heading = x[2] + 0.5 * _STEP * after[1]
            moved = _STEP * np.concatenate([[after[0] * np.cos(heading), after[0] * np.sin(heading)], after[1:]])
            data.xnext = np.concatenate([x[:_POSES] + moved, after])
            data.g = np.concatenate([x[3:_POSES], nu, u])

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            weights, r, J = self._error(x, True)
            nu = x[_POSES:]
            Lx, Lxx = np.zeros(_NX), np.zeros((_NX, _NX))
            weighted = J.T * weights
            Lx[:_POSES], Lxx[:_POSES, :_POSES] = weighted @ r, weighted @ J
            Lx[_POSES:] = _SPEED * nu / velocity**2
            Lxx[range(_POSES, _NX), range(_POSES, _NX)] = _SPEED / velocity**2
            data.Lx, data.Lxx = Lx, Lxx
            Gx = np.zeros((bounds, _NX))
            Gx[:7, 3:_POSES], Gx[7 : 7 + NXI, _POSES:] = np.eye(7), np.eye(NXI)
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
            data.Lu = _EFFORT * u / acceleration**2
            data.Luu = np.diag(_EFFORT / acceleration**2)
            Gu = np.zeros((bounds, NXI))
            Gu[7 + NXI :] = np.eye(NXI)
            data.Gu = Gu

        def _error(self, x: Array, derive: bool) -> tuple[Array, Array, Array]:
            """Weights (6), the tool's error (6) in its own frame, and its derivative over base pose and arm (6×10)."""
            q = np.zeros(NQ)
            q[:3], q[ARM_Q] = x[:3], x[3:_POSES]
            weights = np.array([_PLACE] * 3 + [_TURNING] * 3) * (_LAST if last else _STEP)
            if self.free:
                weights[4] = 0.0
            if not derive:
                T = self.goal.actInv(robot.pose(q, robot.tool_id))
                return weights, pin.log6(T).vector, np.empty((0, 0))
            pin.computeJointJacobians(robot.model, robot.data, q)
            pin.updateFramePlacements(robot.model, robot.data)
            T = self.goal.actInv(robot.data.oMf[robot.tool_id])
            J = pin.getFrameJacobian(robot.model, robot.data, robot.tool_id, pin.LOCAL)
            columns = [0, 1, 2, *range(5, NQ)]
            return weights, pin.log6(T).vector, pin.Jlog6(T) @ J[:, columns]

    return Knot()
