"""Following a planned motion of the tool, of the arm or of an operator's hand, within the limits."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import ControllerConfig
from controller.trajectory import PoseTrajectory, Rates, quintic
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Demand, Method, Task
from rolling_panda.differential_drive import NXI, Array
from rolling_panda.robot_model import ARM_Q, ARM_XI, Kinematics, RobotModel


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
        braked: True when the wanted velocity did not fit and the robot brakes.
        done: True when the motion's clock has run out.
    """

    xi: Array
    desired: Any
    position_error: float
    rotation_error: float
    manipulability: float
    braked: bool
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
        """
        self.q_start, self.q_goal = q_start, q_goal
        self.frozen, self.speed = frozen, speed
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
        self.time = 0.0

    @property
    def done(self) -> bool:
        """True when the clock has reached the end."""
        return self.time >= self.trajectory.duration

    def cap(self, T_odom_tool: Any) -> float:
        """Largest tool speed (m/s) at this tool pose."""
        if not self._slow_end:
            return self.speed * 1.2
        left = _length(self.trajectory.goal.translation - T_odom_tool.translation)
        return self._config.cut_speed + 1.5 * max(0.0, left - self._config.slow_zone)


class Follower:
    """Turns motions into velocities: the whole-body method, then the limits."""

    def __init__(
        self, robot: RobotModel, config: ControllerConfig, method: Method, saturation: Saturation, dt: float
    ) -> None:
        """Bind the parts for a control period of `dt` (s)."""
        self._robot, self._config, self._method, self._saturation, self._dt = robot, config, method, saturation, dt
        self._to_twist = np.linalg.pinv(robot.drive.basis(0.0)[[0, 2], :2])
        self._gains = np.repeat([config.gain_position, config.gain_rotation], 3)

    def follow(self, motion: ToolMotion, robot: Measured) -> Tracking:
        """One period along a tool motion."""
        wanted = motion.trajectory.at(motion.time)
        pose = robot.kinematics.T_odom_tool
        error = tool_error(pose, wanted.T_odom_tool)
        progress = quintic(motion.time, motion.trajectory.duration)
        span = motion.q_goal - motion.q_start
        reference = motion.q_start + span * progress.s
        posture = self._posture(robot.q, reference, span * progress.rate)
        out = self._solve(
            robot, wanted.twist + self._gains * error, posture, motion.frozen, motion.cap(pose), error, wanted
        )
        motion.time += self._dt * out.scale
        return out.tracking(motion.done)

    def seek(self, goal: Any, q_goal: Array, robot: Measured) -> Tracking:
        """One period towards a pose that may move (teleoperation): proportional, at a bounded speed and turn."""
        error = tool_error(robot.kinematics.T_odom_tool, goal)
        twist = self._gains * error
        for part, bound in ((slice(0, 3), self._config.teleop_speed), (slice(3, 6), self._config.teleop_turn)):
            size = _length(twist[part])
            if size > bound:
                twist[part] *= bound / size
        # Only the heading is held: where along the row the base stands follows from the tool.
        posture = self._posture(robot.q, np.concatenate([robot.q[:5], q_goal[ARM_Q]]), np.zeros(12))
        wanted = _Wanted(goal)
        return self._solve(robot, twist, posture, False, self._config.teleop_speed, error, wanted).tracking(False)

    def _posture(self, q: Array, reference: Array, rate: Array) -> Array:
        """Velocity over ξ (9) towards a posture: base along the row and parallel to it, arm joints to theirs."""
        config = self._config
        out = np.empty(NXI)
        c, s = np.cos(config.row_heading), np.sin(config.row_heading)
        along = c * (reference[0] - q[0]) + s * (reference[1] - q[1])
        speed = config.gain_posture * along + c * rate[0] + s * rate[1]
        speed = max(-config.base_speed, min(config.base_speed, speed))
        turn = config.gain_heading * float(np.sin(config.row_heading - q[2]))
        turn = max(-config.base_yaw_rate, min(config.base_yaw_rate, turn))
        out[:2] = self._to_twist @ (speed, turn)
        out[ARM_XI] = config.gain_posture * (reference[ARM_Q] - q[ARM_Q]) + rate[ARM_Q]
        return out

    def _solve(
        self, robot: Measured, twist: Array, posture: Array, frozen: bool, cap: float, error: Array, wanted: Any
    ) -> "_Solved":
        k = robot.kinematics
        solution = self._method.solve(Demand(robot.q, k, Task("tool", k.J_xi, twist), posture, frozen))
        speed = _length(k.J_xi[:3] @ solution.xi)
        share = min(1.0, cap / speed) if speed > 0.0 else 1.0
        limited = self._saturation.apply(solution.xi * share, robot.q, robot.sent)
        return _Solved(limited.xi, limited.scale * share, limited.braked, error, wanted, solution.manipulability)


@dataclass(frozen=True)
class _Wanted:
    T_odom_tool: Any


@dataclass(frozen=True)
class _Solved:
    xi: Array
    scale: float
    braked: bool
    error: Array
    wanted: Any
    manipulability: float

    def tracking(self, done: bool) -> Tracking:
        position, rotation = _length(self.error[:3]), _length(self.error[3:])
        return Tracking(self.xi, self.wanted.T_odom_tool, position, rotation, self.manipulability, self.braked, done)


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


def _length(vector: Array) -> float:
    """Euclidean length, in a tenth of the time that numpy.linalg.norm takes."""
    return math.sqrt(float(vector @ vector))
