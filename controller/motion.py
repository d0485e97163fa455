"""Following a planned motion of the tool, of the arm or of an operator's hand."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import ControllerConfig
from controller.trajectory import PoseTrajectory, Rates, quintic
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import BaseMode, Demand, Method, Posture, Solution, ToolTask
from rolling_panda.differential_drive import NXI, Array
from rolling_panda.robot_model import ARM_Q, ARM_XI, Kinematics


@dataclass(frozen=True)
class Measured:
    """The robot in one control period: q (12), tool kinematics at q, and the velocity sent last (9)."""

    q: Array
    kinematics: Kinematics
    sent: Array


@dataclass(frozen=True)
class Tracking:
    """What following a motion gave.

    Attributes:
        xi: ξ̇ to send (9), within every limit.
        desired: T_odom_tool wanted now (pin.SE3), None when only joints are moved.
        position_error: Of the tool against `desired` (m).
        rotation_error: The same (rad).
        manipulability: ω of the arm.
        feasible: False when what was wanted could not be done within the limits.
        reason: Why not, in words; empty when it could.
        done: True when the motion's clock has run out.
    """

    xi: Array
    desired: Any
    position_error: float
    rotation_error: float
    manipulability: float
    feasible: bool
    reason: str
    done: bool


class ToolMotion:
    """A straight tool motion with the posture that goes with it; its clock advances as far as the limits let it."""

    def __init__(
        self,
        config: ControllerConfig,
        start: Any,
        goal: Any,
        q_start: Array,
        q_goal: Array,
        speed: float,
        frozen: bool = False,
        slow_end: bool = False,
        free_axis: bool = False,
    ) -> None:
        """Plan.

        Args:
            config: Of the controller.
            start: T_odom_tool at the beginning (pin.SE3).
            goal: T_odom_tool at the end (pin.SE3).
            q_start: Configuration (12) at the beginning.
            q_goal: Configuration (12) wanted at the end, for the null space.
            speed: Largest tool speed (m/s).
            frozen: True where only the arm moves.
            slow_end: True for the way to the cut: the last `slow_zone` is at `cut_speed`.
            free_axis: True where the rotation about the tool's y does not matter.
        """
        self.q_start, self.q_goal = q_start, q_goal
        self.base: BaseMode = "frozen" if frozen else "row"
        self.speed, self.free_axis = speed, free_axis
        self._slow_end, self._config = slow_end, config
        travel = 0.0 if frozen else float(np.hypot(*(q_goal[:2] - q_start[:2])))
        # The base and the joints need their time too, with room for feedback.
        base_s = Rates(0.8 * config.base_speed, 0.5 * config.base_acceleration, 10.0).duration(travel)
        arm_s = Rates(0.9, 2.0, 20.0).duration(float(np.abs(q_goal[ARM_Q] - q_start[ARM_Q]).max()))
        self.trajectory = PoseTrajectory(
            start,
            goal,
            Rates(speed, config.tool_acceleration, config.tool_jerk),
            Rates(config.tool_turn, 3.0 * config.tool_acceleration, 3.0 * config.tool_jerk),
            max(base_s, arm_s),
            straight=True,
        )
        self.time, self.scale = 0.0, 1.0

    @property
    def done(self) -> bool:
        """True when the clock has reached the end."""
        return self.time >= self.trajectory.duration

    def advance(self, scale: float, dt: float) -> None:
        """Let the clock run at the rate `scale` for one period of `dt` (s)."""
        self.scale = scale
        self.time += dt * scale

    def posture(self) -> Posture:
        """Base and arm as they should be now: in a straight line from start to goal, heading as at the goal."""
        progress = quintic(self.time, self.trajectory.duration)
        span = self.q_goal - self.q_start
        q, rate = self.q_start + span * progress.s, span * progress.rate
        q[2], rate[2] = self.q_goal[2], 0.0
        return Posture(q, rate, self.q_goal)

    def cap(self, T_odom_tool: Any) -> float:
        """Largest tool speed (m/s) at this tool pose."""
        if not self._slow_end:
            return self.speed * 1.2
        left = _length(self.trajectory.goal.translation - T_odom_tool.translation)
        return self._config.cut_speed + 1.5 * max(0.0, left - self._config.slow_zone)


class Follower:
    """Turns motions into velocities by the whole-body method."""

    def __init__(self, config: ControllerConfig, method: Method, dt: float) -> None:
        """Bind the parts for a control period of `dt` (s)."""
        self._config, self._method, self._dt = config, method, dt
        self._gains = np.repeat([config.gain_position, config.gain_rotation], 3)

    def follow(self, motion: ToolMotion, robot: Measured) -> Tracking:
        """One period along a tool motion."""
        wanted = motion.trajectory.at(motion.time)
        pose = robot.kinematics.T_odom_tool
        error = tool_error(pose, nearest_about_y(pose, wanted.T_odom_tool) if motion.free_axis else wanted.T_odom_tool)
        out = self._method.solve(
            Demand(
                robot.q,
                robot.kinematics,
                robot.sent,
                ToolTask(wanted.twist + self._gains * error, motion.free_axis),
                motion.posture(),
                motion.base,
                motion.cap(pose),
                motion.scale,
            )
        )
        motion.advance(out.scale, self._dt)
        return _tracking(out, wanted.T_odom_tool, error, motion.done)

    def seek(self, goal: Any, q_goal: Array, robot: Measured, base: BaseMode = "free") -> Tracking:
        """One period towards a pose that may move (teleoperation): proportional, at a bounded speed and turn.

        Args:
            goal: T_odom_tool wanted (pin.SE3).
            q_goal: Configuration (12) of which heading and arm posture are kept to.
            robot: Measured robot.
            base: What the base is for.
        """
        error = tool_error(robot.kinematics.T_odom_tool, goal)
        twist = self._gains * error
        for part, bound in ((slice(0, 3), self._config.teleop_speed), (slice(3, 6), self._config.teleop_turn)):
            size = _length(twist[part])
            if size > bound:
                twist[part] *= bound / size
        posture = q_goal.copy()
        posture[:2] = robot.q[:2]
        demand = Demand(
            robot.q,
            robot.kinematics,
            robot.sent,
            ToolTask(twist, keep_path=False),
            Posture(posture),
            base,
            self._config.teleop_speed,
        )
        return _tracking(self._method.solve(demand), goal, error, False)


def _tracking(out: Solution, desired: Any, error: Array, done: bool) -> Tracking:
    position, rotation = _length(error[:3]), _length(error[3:])
    return Tracking(out.xi, desired, position, rotation, out.manipulability, out.feasible, out.reason, done)


class ArmMotion:
    """A motion of the arm's joints with the base still: quintic in every joint."""

    def __init__(self, config: ControllerConfig, start: Array, goal: Array) -> None:
        """Plan from one posture (7) to another (7)."""
        self._start, self._span = start, goal - start
        self._gain = config.gain_position
        self.duration = Rates(0.6, 1.0, 10.0).duration(float(np.abs(self._span).max()))
        self.time = 0.0

    @property
    def done(self) -> bool:
        """True when the clock has reached the end."""
        return self.time >= self.duration

    def step(self, robot: Measured, saturation: Saturation, dt: float) -> Array:
        """One period: ξ̇ to send (9)."""
        progress = quintic(self.time, self.duration)
        xi = np.zeros(NXI)
        xi[ARM_XI] = self._span * progress.rate + self._gain * (self._start + self._span * progress.s - robot.q[ARM_Q])
        limited = saturation.apply(xi, robot.q, robot.sent)
        self.time += dt * limited.scale
        return limited.xi


def tool_error(T_odom_tool: Any, T_odom_goal: Any) -> Array:
    """Twist (6, odom's axes, at the tool) that takes the tool to the goal in one second: the SE(3) logarithm."""
    screw = pin.log6(T_odom_tool.actInv(T_odom_goal))
    R = T_odom_tool.rotation
    return np.concatenate([R @ screw.linear, R @ screw.angular])


def nearest_about_y(T_odom_tool: Any, T_odom_goal: Any) -> Any:
    """The goal (pin.SE3) turned about its own y axis until its orientation is nearest to the tool's."""
    M = T_odom_goal.rotation.T @ T_odom_tool.rotation
    angle = math.atan2(M[0, 2] - M[2, 0], M[0, 0] + M[2, 2])
    return pin.SE3(T_odom_goal.rotation @ pin.exp3(np.array([0.0, angle, 0.0])), T_odom_goal.translation)


def _length(vector: Array) -> float:
    """Euclidean length, in a tenth of the time that numpy.linalg.norm takes."""
    return math.sqrt(float(vector @ vector))
