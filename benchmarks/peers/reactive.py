"""Reactive controllers of others as whole-body methods: Pink, mink, and the holistic QP of Haviland and others.

Each answers one control period's problem, with the same limits: what it does not keep itself, `Saturation` scales in
time, as it does for the method `nullspace`. None of them knows obstacles or the distance between the robot's parts.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

import daqp
import numpy as np
import pinocchio as pin

from benchmarks.peers.problem import rates, robot_urdf
from controller.config import WholeBodyConfig
from controller.motion.follower import tool_error
from controller.whole_body.actuation import Actuation
from controller.whole_body.manipulability import ArmManipulability
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import ActuatorTask, IkProblem, Method, Solution, ToolTask
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

#: Costs of tool and posture tasks, and the share of the posture's error that is made good in a period.
_TOOL, _POSTURE, _POSTURE_GAIN = 1.0, 1e-3, 0.01
#: Which entries of q are actuators: wheels and arm.
_ACTUATED = [3, 4, *range(5, NQ)]


class Aimed(Method, Protocol):
    """A method that is told where a motion ends (pin.SE3), and whether the tool may turn about its y there."""

    def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
        """Begin a motion."""
        ...


class _Peer(ABC):
    """What the peers share: limits, and a stop where there is no answer."""

    name = ""
    flows = True

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        self._robot, self._dt = robot, dt
        self._saturation = Saturation(robot, config, dt)
        self._manipulability = ArmManipulability()
        self._goal: Any = None

    def aim(self, T_odom_goal: Any, free_axis: bool) -> None:
        """Where the motion that begins now is to end; see `Aimed`."""
        self._goal = T_odom_goal

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        omega = self._manipulability.at(problem.kinematics.J).value
        wanted = problem.tool.xi if isinstance(problem.tool, ActuatorTask) else self._wanted(problem)
        if wanted is None or not np.isfinite(wanted).all():
            return Solution(self._saturation.brake(problem.sent), 0.0, omega, False, f"{self.name} has no answer")
        limited = self._saturation.apply(wanted, problem.q, problem.sent)
        return Solution(limited.xi, limited.scale, omega, not limited.braked, "a limit" if limited.braked else "")

    @abstractmethod
    def _wanted(self, problem: IkProblem) -> Array | None:
        """ξ̇ (9) before any limit but those that the peer keeps itself; None without an answer."""

    def _constraints(self, problem: IkProblem, rolling: Any, wheels: Any) -> list[Any]:
        """Rolling, and the wheels' velocities where they are given: at rest, or as they are measured."""
        if not problem.arm_only:
            return [rolling]
        held = problem.held if problem.base != "frozen" else None
        wheels.moved = np.zeros(2) if held is None else held * self._dt
        return [rolling, wheels]

    def _target(self, problem: IkProblem) -> Any:
        """The pose (pin.SE3) that the tool has after one period of its twist."""
        assert isinstance(problem.tool, ToolTask)
        T, moved = problem.kinematics.T_odom_tool, problem.tool.twist * self._dt
        return pin.SE3(pin.exp3(moved[3:]) @ T.rotation, T.translation + moved[:3])


class Pink(_Peer):
    """Pink (package pin-pink) with DAQP: weighted tasks, all limits, rolling wheels as a constraint."""

    name = "pink"

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Build its tasks and limits for a control period of `dt` (s)."""
        super().__init__(robot, config, dt)
        import pink
        from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
        from pink.tasks import FrameTask, PostureTask

        self._pink, self._model = pink, pin.Model(robot.model)
        velocity, acceleration = rates(robot, config)
        self._model.velocityLimit = velocity
        self._data = self._model.createData()
        self._tools = {
            free: FrameTask("tool", position_cost=_TOOL, orientation_cost=_turning(free)) for free in (False, True)
        }
        self._posture = PostureTask(cost=_POSTURE, gain=_POSTURE_GAIN)
        self._acceleration = AccelerationLimit(self._model, acceleration)
        self._limits = [ConfigurationLimit(self._model), VelocityLimit(self._model), self._acceleration]
        self._rolling, self._wheels = _constraints_of(pink.tasks.Task, robot, list(range(NQ)), cost=1.0, gain=1.0)

    def _wanted(self, problem: IkProblem) -> Array | None:
        assert isinstance(problem.tool, ToolTask)
        configuration = self._pink.Configuration(self._model, self._data, problem.q, copy_data=False)
        tool = self._tools[problem.tool.free_axis]
        tool.set_target(self._target(problem))
        self._posture.set_target(problem.posture.q)
        self._acceleration.set_last_integration(problem.kinematics.S @ problem.sent, self._dt)
        try:
            v = self._pink.solve_ik(
                configuration,
                [tool, self._posture],
                self._dt,
                solver="daqp",
                limits=self._limits,
                constraints=self._constraints(problem, self._rolling, self._wheels),
                safety_break=False,
            )
        except self._pink.exceptions.PinkError:
            return None
        wanted: Array = v[_ACTUATED]
        return wanted


class Mink(_Peer):
    """mink with DAQP on MuJoCo's model: weighted tasks, limits of position and velocity, rolling wheels."""

    name = "mink"

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Build its model, tasks and limits for a control period of `dt` (s)."""
        super().__init__(robot, config, dt)
        import mink

        self._mink = mink
        model = _mujoco_model()
        names = [model.joint(i).name for i in range(model.njnt)]
        velocity, _ = rates(robot, config)
        ours = [str(name) for name in robot.model.names][1:]
        speeds = {name: velocity[ours.index(name)] for name in names}
        #: Our index of each of its joints.
        self._order = [ours.index(name) for name in names]
        self._tools = {
            free: mink.FrameTask("tool", "body", position_cost=_TOOL, orientation_cost=_turning(free))
            for free in (False, True)
        }
        self._posture = mink.PostureTask(model, cost=_POSTURE, gain=_POSTURE_GAIN)
        self._limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
        self._configuration = mink.Configuration(model)
        self._rolling, self._wheels = _constraints_of(mink.Task, robot, self._order, cost=np.ones(1), gain=1.0)

    def _wanted(self, problem: IkProblem) -> Array | None:
        assert isinstance(problem.tool, ToolTask)
        self._configuration.update(problem.q[self._order])
        tool = self._tools[problem.tool.free_axis]
        tool.set_target(self._mink.SE3.from_matrix(self._target(problem).homogeneous))
        self._posture.set_target(problem.posture.q[self._order])
        try:
            v = self._mink.solve_ik(
                self._configuration,
                [tool, self._posture],
                self._dt,
                "daqp",
                limits=self._limits,
                constraints=self._constraints(problem, self._rolling, self._wheels),
            )
        except self._mink.MinkError:
            return None
        ordered = np.empty(NQ)
        ordered[self._order] = v
        wanted: Array = ordered[_ACTUATED]
        return wanted


class Holistic(_Peer):
    """The holistic QP of Haviland, Sünderhauf and Corke (2022), after its equations, with DAQP.

    Over ν = [v, φ̇, q̇] and a slack δ (6) of the tool's twist: ½ xᵀ Q x + cᵀ x subject to J ν + δ = twist, velocity
    dampers at the joint limits, and limits of velocity and, which is ours, of acceleration. The base costs the more the
    nearer the tool is, the slack too; c has the gradient of the arm's manipulability and turns the base to face the
    tool. It knows no free axis, and counts as arrived within 20 mm. Where it is not aimed, as in rows, the twist is the
    motion's, and its goal the motion's end.
    """

    name = "holistic"
    #: Gain of the servo (1/s), cost of joint velocities, gain of facing the tool, and the dampers' distances (rad) and
    #: gain, as published.
    _SERVO, _JOINTS, _FACING, _STOP, _INFLUENCE, _DAMPING = 1.5, 0.01, 0.5, 0.1, 0.9, 1.0
    #: Least distance to the goal that counts (m). Where it stops: so near (m), turned by ten times that (rad).
    #: Bound of the slack (m/s, rad/s).
    _LEAST, _THERE, _SLACK = 1e-3, 1e-4, 10.0

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Bind robot and limits for a control period of `dt` (s)."""
        super().__init__(robot, config, dt)
        self._actuation = Actuation(robot.drive)
        self._most = np.concatenate(
            [
                [config.base_speed, config.base_yaw_rate],
                robot.limits.velocity[ARM_XI] * config.arm_velocity_scale,
                np.full(6, self._SLACK),
            ]
        )
        self._lower, self._upper = robot.limits.lower[ARM_Q], robot.limits.upper[ARM_Q]
        # Both turning and driving change the speed of a wheel.
        base = [0.5 * config.base_acceleration, 0.5 * config.base_acceleration / robot.drive.half_track]
        arm = robot.limits.acceleration[ARM_XI] * config.arm_acceleration_scale
        self._step = dt * np.concatenate([base, arm])

    def _wanted(self, problem: IkProblem) -> Array | None:
        assert isinstance(problem.tool, ToolTask)
        T, count = problem.kinematics.T_odom_tool, NXI + 6
        goal = self._goal
        if goal is None:
            goal = T if problem.tool.ahead is None else problem.tool.ahead(math.inf)
        error = tool_error(T, goal)
        if self._goal is None:
            twist = problem.tool.twist
        elif float(np.abs(error[:3]).max()) < self._THERE and float(np.abs(error[3:]).max()) < 10.0 * self._THERE:
            return np.zeros(NXI)
        else:
            twist = self._SERVO * error
        # The distance that is left, in its own measure: the sum of the coordinates.
        left = max(self._LEAST, float(np.abs(error[:3]).sum()))
        Q = np.zeros((count, count))
        Q[range(count), range(count)] = [1.0 / left] * 2 + [self._JOINTS] * 7 + [1.0 / left] * 6
        c = np.zeros(count)
        ahead = T.translation[:2] - problem.q[:2]
        bearing = math.atan2(ahead[1], ahead[0]) - problem.q[2]
        c[1] = -self._FACING * math.atan2(math.sin(bearing), math.cos(bearing))
        c[ARM_XI] = -self._manipulability.at(problem.kinematics.J).gradient[ARM_XI]
        A = np.hstack([self._actuation.rows(problem.kinematics.J_xi), np.eye(6)])
        lower, upper = -self._most, self._most.copy()
        arm = problem.q[ARM_Q]
        for i in range(7):
            above, below = self._upper[i] - arm[i], arm[i] - self._lower[i]
            if above < self._INFLUENCE:
                upper[2 + i] = min(upper[2 + i], self._damper(above))
            if below < self._INFLUENCE:
                lower[2 + i] = max(lower[2 + i], -self._damper(below))
        # What the accelerations allow goes before the dampers.
        sent = self._actuation.nu(problem.sent)
        lower[:NXI] = np.minimum(np.maximum(lower[:NXI], sent - self._step), sent + self._step)
        upper[:NXI] = np.maximum(np.minimum(upper[:NXI], sent + self._step), sent - self._step)
        if problem.arm_only:
            lower[:2] = upper[:2] = 0.0 if problem.base == "frozen" else self._actuation.nu(problem.sent)[:2]
        sense = np.zeros(count + 6, dtype=np.int32)
        # Rows after the bounds are equalities.
        sense[count:] = 5
        x, _, flag, _ = daqp.solve(Q, c, A, np.concatenate([upper, twist]), np.concatenate([lower, twist]), sense)
        return self._actuation.xi(np.asarray(x)[:NXI]) if flag > 0 else None

    def _damper(self, distance: float) -> float:
        return max(0.0, self._DAMPING * (distance - self._STOP) / (self._INFLUENCE - self._STOP))


_MAKERS: dict[str, Callable[[RobotModel, WholeBodyConfig, float], Aimed]] = {
    "pink": Pink,
    "mink": Mink,
    "holistic": Holistic,
}
#: The peers by name.
REACTIVE = tuple(_MAKERS)


def reactive(name: str, robot: RobotModel, config: WholeBodyConfig, dt: float) -> Aimed:
    """A peer as a whole-body method.

    Raises:
        RollingPandaError: Its package is not installed.
    """
    try:
        return _MAKERS[name](robot, config, dt)
    except ImportError as error:
        raise RollingPandaError(f"{name} is not installed ({error}); `make peers` installs it") from error


def _turning(free: bool) -> Any:
    """Costs of the tool's turning about its x, y and z."""
    return [_TOOL, 0.0 if free else _TOOL, _TOOL]


def _constraints_of(task: Any, robot: RobotModel, order: list[int], **costs: Any) -> tuple[Any, Any]:
    """A(q) Δq = 0, and given wheels, as tasks of Pink or mink; `order` has our index of each of its joints."""
    heading, pick = order.index(2), np.eye(NQ)[3:5][:, order]

    class Rolling(task):  # type: ignore[misc]
        def compute_error(self, configuration: Any) -> Any:
            return np.zeros(3)

        def compute_jacobian(self, configuration: Any) -> Any:
            return robot.drive.constraint(float(configuration.q[heading]))[:, order]

        def __repr__(self) -> str:
            return "Rolling()"

    class Wheels(task):  # type: ignore[misc]
        moved = np.zeros(2)

        def compute_error(self, configuration: Any) -> Any:
            return -self.moved

        def compute_jacobian(self, configuration: Any) -> Any:
            return pick

        def __repr__(self) -> str:
            return "Wheels()"

    return Rolling(**costs), Wheels(**costs)


def _mujoco_model() -> Any:
    import mujoco

    compiler = '<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6"/></mujoco><link'
    return mujoco.MjModel.from_xml_string(robot_urdf().replace("<link", compiler, 1))
