"""One target and one method: plan where the method plans, then closed-loop control of a kinematic robot.

The robot does in each period exactly what is sent: velocities as commanded, the base on the arc of its wheels. What the
method sends is not limited again, so that a limit that it breaks is seen.
"""

import time
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from benchmarks.control.goal_planner import GOOD_OMEGA, GoalPlanner
from benchmarks.control.path import Refused
from benchmarks.control.plan_follower import PlanFollower
from benchmarks.control.plan_limits import plan_limits
from benchmarks.control.reach_judge import POSITION, ROTATION, BaseBounds, Trajectory, goal_error, within
from benchmarks.peers.predictive import Predictive
from benchmarks.peers.reactive import REACTIVE, Aimed, reactive
from controller.config import ControllerConfig, HierarchyConfig, MotionConfig, WholeBodyConfig, WorkConfig
from controller.motion.follower import tool_error
from controller.motion.rest_to_rest import Rates
from controller.motion.tool_motion import PoseTrajectory
from controller.whole_body.collision import CollisionModel
from controller.whole_body.registry import make_method
from controller.whole_body.task import IkProblem, Method, Posture, Solution, ToolTask
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import RobotModel

MethodName = Literal["hierarchy", "nullspace", "decoupled", "pink", "mink", "holistic", "mpc"]
METHODS: tuple[MethodName, ...] = get_args(MethodName)
#: Longest motion (s), and the control period (s).
LIMIT_S, DT = 30.0, 0.01
#: The base's vendor's planner: 0.8 m/s, 0.6 rad/s.
BASE = BaseBounds(0.8, 0.6)
_GAIN = 3.0
#: What has not arrived this long before the time is over stops (s).
_STOPPING_S = 0.8
#: A motion ends when the tool is nearer than this share of the tolerance and every joint and wheel as good as at rest
#: (rad/s), so that it may stop within one period.
_BETTER, _REST = 0.2, 0.02
#: Periods within the tolerance after which a motion without a plan has ended, and periods at rest (rad/s) after which
#: it has: it is stuck.
_HOVER, _STUCK, _STILL = 100, 300, 1e-4


@dataclass(frozen=True)
class Outcome:
    """What a run gave.

    Attributes:
        trajectory: What was done; a single row where nothing was.
        infeasible: Periods in which the method could not do all that was asked.
        planned_s: Processor time of planning (s).
        reason: Why there is no plan, or the method's last complaint; empty where all went well.
        refused: True where no plan was found and nothing moved.
        steps_s: Processor time of each solution (s).
    """

    trajectory: Trajectory
    infeasible: int
    planned_s: float
    reason: str
    refused: bool = False
    steps_s: tuple[float, ...] = ()


class Runner:
    """Runs targets with one method. One instance a process."""

    def __init__(self, method: MethodName, seed: int = 0) -> None:
        """Build robot, planner and method.

        Args:
            method: `hierarchy` follows a plan, base and arm together; `decoupled` a plan that drives, stops, and then
                reaches, with the same controller; `nullspace` is the paper's: a straight screw, without a plan. The
                others are peers (`benchmarks.peers`): `pink` and `mink` follow the same screw, `holistic` and `mpc` go
                to the goal in their own way.
            seed: Of the planner.

        Raises:
            RollingPandaError: A peer's package is not installed.
        """
        self.robot = RobotModel()
        self.collision = CollisionModel(RobotModel())
        config = bench_config(method)
        self._config, self._method_name = config, method
        self._peer: Aimed | None = None
        if method in REACTIVE:
            self._peer = reactive(method, self.robot, config.whole_body, DT)
        elif method == Predictive.name:
            self._peer = Predictive(self.robot, config.whole_body, DT)
        self._method: Method = self._peer or make_method(self.robot, config.whole_body, DT)
        limits = plan_limits(self.robot, BASE.speed, BASE.yaw_rate, config.whole_body.base_acceleration, dt=DT)
        planning = RobotModel()
        self._planner = GoalPlanner(planning, CollisionModel(planning), limits, seed)

    def least_time(self, q: Array, goal: Any, free: bool) -> float | None:
        """Lower bound of the time to a goal (s); see `GoalChooser.least_time`."""
        return self._planner.least_time(q, goal, free)

    def run(self, q: Array, goal: Any, free: bool, base_fixed: bool = False, good_omega: float = GOOD_OMEGA) -> Outcome:
        """From rest at a configuration (12) towards a tool pose (pin.SE3); see `GoalPlanner.plan`."""
        if self._peer is not None or self._method_name == "nullspace":
            return self._to_goal(q, goal, free, base_fixed)
        began = time.process_time()
        planned = self._planner.plan(
            q, goal, free, base_fixed, together=self._method_name != "decoupled", good_omega=good_omega
        )
        planned_s = time.process_time() - began
        if isinstance(planned, Refused):
            return Outcome(Trajectory(np.zeros(1), q[None], np.zeros((1, NXI))), 0, planned_s, planned.reason, True)
        follower = PlanFollower(self.robot, self._method, planned.plan, _GAIN, free, base_fixed)
        loop = _Loop(self.robot, q)
        while loop.time < LIMIT_S - DT / 2:
            kinematics = self.robot.kinematics(loop.q)
            if follower.done and _arrived(goal_error(kinematics.T_odom_tool, goal, free), loop.xi):
                break
            if loop.time > LIMIT_S - _STOPPING_S:
                loop.stop()
            else:
                began_step = time.thread_time()
                solution = follower.step(loop.q, kinematics, loop.xi)
                loop.steps_s.append(time.thread_time() - began_step)
                loop.take(solution)
        return loop.outcome(planned_s)

    def _to_goal(self, q: Array, goal: Any, free: bool, base_fixed: bool) -> Outcome:
        config = self._config
        trajectory = PoseTrajectory(
            self.robot.pose(q, self.robot.tool_id),
            goal,
            Rates(config.work.tool_speed, config.motion.tool_acceleration, config.motion.tool_jerk),
            Rates(config.motion.tool_turn, 3.0 * config.motion.tool_acceleration, 3.0 * config.motion.tool_jerk),
        )
        if self._peer is not None:
            self._peer.aim(goal, free)
        loop, clock = _Loop(self.robot, q), 0.0
        scale, there, still = 1.0, 0, 0
        while loop.time < LIMIT_S - DT / 2:
            kinematics = self.robot.kinematics(loop.q)
            left = goal_error(kinematics.T_odom_tool, goal, free)
            # Some peers hover about the goal, and still move.
            there = there + 1 if within(left, POSITION, ROTATION) else 0
            still = still + 1 if float(np.abs(loop.xi).max()) < _STILL else 0
            if (
                (there > _HOVER and loop.can_stop)
                or still > _STUCK
                or (clock >= trajectory.duration and _arrived(left, loop.xi))
            ):
                break
            if loop.time > LIMIT_S - _STOPPING_S:
                loop.stop()
                continue
            wanted = trajectory.at(clock)
            error = _GAIN * tool_error(kinematics.T_odom_tool, wanted.T_odom_tool)
            problem = IkProblem(
                q=loop.q,
                kinematics=kinematics,
                sent=loop.xi,
                tool=ToolTask(wanted.twist + error, free_axis=free),
                # No posture is wanted: where the robot is, is right.
                posture=Posture(loop.q),
                base="frozen" if base_fixed else "free",
                scale=scale,
            )
            began = time.thread_time()
            solution = self._method.solve(problem)
            loop.steps_s.append(time.thread_time() - began)
            scale = solution.scale
            clock += DT * scale
            loop.take(solution)
        if isinstance(self._peer, Predictive):
            # Between its turns it only goes on.
            loop.steps_s = self._peer.seconds
        return loop.outcome(0.0)


class _Loop:
    """The kinematic robot and its record."""

    def __init__(self, robot: RobotModel, q: Array) -> None:
        self.q, self.xi, self.time = q.copy(), np.zeros(NXI), 0.0
        self._drive, self._slowing = robot.drive, 0.5 * DT * robot.limits.acceleration
        self._rows: list[Array] = [q.copy()]
        self._sent: list[Array] = []
        self._infeasible, self._reason = 0, ""
        #: Processor time of each solution (s).
        self.steps_s: list[float] = []

    def take(self, solution: Solution) -> None:
        """One period with what the method sends."""
        if not solution.feasible:
            self._infeasible, self._reason = self._infeasible + 1, solution.reason
        self._move(solution.xi)

    def _move(self, xi: Array) -> None:
        self.xi = xi
        self.q = self.q.copy()
        self.q[:3] = self._drive.integrate(self.q[:3], float(self.xi[0] * DT), float(self.xi[1] * DT))
        self.q[3:] += self.xi * DT
        self.time += DT
        self._rows.append(self.q)
        self._sent.append(self.xi)

    @property
    def can_stop(self) -> bool:
        """Whether it comes to rest within one period, at half of the rated accelerations."""
        return float((np.abs(self.xi) / self._slowing).max()) <= 1.0

    def stop(self) -> None:
        """One period of slowing down along the same direction, at half of the rated accelerations."""
        largest = float((np.abs(self.xi) / self._slowing).max())
        self._move(np.zeros(NXI) if largest <= 1.0 else self.xi * (1.0 - 1.0 / largest))

    def outcome(self, planned_s: float) -> Outcome:
        """What was done."""
        t: Array = DT * np.arange(len(self._rows), dtype=np.float64)
        xi = np.vstack([*self._sent, np.zeros(NXI)])
        done = Trajectory(t, np.array(self._rows), xi)
        return Outcome(done, self._infeasible, planned_s, self._reason, steps_s=tuple(self.steps_s))


def bench_config(method: MethodName) -> ControllerConfig:
    """The controller with the arm's full rates and the base's as its vendor's planner has them."""
    return ControllerConfig(
        whole_body=WholeBodyConfig(
            method="nullspace" if method == "nullspace" else "hierarchy",
            base_speed=BASE.speed,
            base_yaw_rate=BASE.yaw_rate,
            base_acceleration=0.8,
            base_yaw_acceleration=1.3,
            arm_velocity_scale=1.0,
            arm_acceleration_scale=1.0,
            joint_margin=0.005,
            # The plan has chosen its postures: in the null space nothing else is wanted, and where it leads past a
            # singularity, damping would only lead off it.
            hierarchy=HierarchyConfig(manipulability=0.0, joint_centre=0.0, damping=1e-5),
        ),
        motion=MotionConfig(tool_turn=1.0),
        # 4√2 m in 30 s with the quintic's peak at 1.875 of the mean.
        work=WorkConfig(tool_speed=0.8),
    )


def _arrived(error: Array, xi: Array) -> bool:
    return within(error, _BETTER * POSITION, _BETTER * ROTATION) and float(np.abs(xi).max()) < _REST
