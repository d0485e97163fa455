"""Followers of tool motions, arm motions and teleoperation."""

import math
from typing import Any, Final

import numpy as np
import pinocchio as pin
from msgspec import Struct

from controller.config import MotionConfig, TeleoperationConfig
from controller.motion.rest_to_rest import Rates, quickest
from controller.motion.tool_motion import ToolMotion, ToolState
from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.task import ActuatorTask, BaseMode, IkProblem, Method, Posture, Solution, ToolTask
from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import ARM_Q, ARM_XI, Kinematics


class Measured(Struct, frozen=True):
    """State of the robot in one control period.

    Attributes:
        q: Configuration (12), with the base in odom.
        kinematics: Kinematics of the tool at q.
        sent: Last command ξ̇ (9, rad/s).
        frame: Where odom is in map.
    """

    q: Array
    kinematics: Kinematics
    sent: Array
    frame: MapFrame = MapFrame()

    def in_map(self, q: Array) -> Array:
        """A configuration (12) with the base in map of one in odom."""
        return self.frame.configuration_in_map(q)


class Tracking(Struct, frozen=True):
    """What following a motion gave.

    Attributes:
        xi: ξ̇ to send (9), within every limit.
        desired: T_odom_tool wanted now (pin.SE3), None when only joints are moved.
        position_error: Of the tool against `desired` (m).
        rotation_error: The same (rad).
        manipulability: ω of the arm.
        feasible: False when what was wanted could not be done within the limits.
        reason: Name of what holds the robot back; empty without one.
        done: True when the motion's clock has run out.
        scale: Rate of the motion's clock, 0…1.
    """

    xi: Array
    desired: Any
    position_error: float
    rotation_error: float
    manipulability: float
    feasible: bool
    reason: str
    done: bool
    scale: float = 1.0


class Follower:
    """Turns motions into velocities by the whole-body method."""

    def __init__(self, config: MotionConfig, method: Method, dt: float) -> None:
        """Bind the parts for a control period of `dt` (s)."""
        self._method, self._dt = method, dt
        self._J_before: Array | None = None
        self._gains = np.repeat([config.gain_position, config.gain_rotation], 3)
        self._lag = config.arm_lag_s + 0.5 * dt if config.arm_lag_s else 0.0

    @property
    def flows(self) -> bool:
        """Whether the legs of a way may flow into each other."""
        return self._method.flows

    def follow(self, motion: ToolMotion, robot: Measured) -> Tracking:
        """One period along a tool motion."""
        wanted = motion.desired()
        pose = robot.kinematics.T_odom_tool
        error = tool_error(pose, nearest_about_y(pose, wanted.T_odom_tool) if motion.free_axis else wanted.T_odom_tool)
        out = self._method.solve(
            IkProblem(
                robot.q,
                robot.kinematics,
                robot.sent,
                ToolTask(self._twist(wanted, motion.scale, error, robot), motion.free_axis, ahead=motion.ahead),
                motion.posture(),
                motion.base,
                motion.cap(pose),
                motion.scale,
            )
        )
        motion.advance(out.scale, self._dt)
        return _tracking(out, wanted.T_odom_tool, error, motion.done)

    def _twist(self, wanted: ToolState, scale: float, error: Array, robot: Measured) -> Array:
        """Commanded twist (6): desired twist, error feedback, and a lead for the servos' lag."""
        J, twist = robot.kinematics.J_xi, np.empty(6)
        before, self._J_before = J if self._J_before is None else self._J_before, J
        _command_twist(
            wanted.twist,
            wanted.acceleration,
            scale,
            J,
            before,
            robot.sent,
            self._lag,
            self._dt,
            self._gains,
            error,
            twist,
        )
        return twist

    def jog(self, xi: Array, robot: Measured) -> Tracking:
        """One period of the actuators' own velocities ξ̇ (9, rad/s), within the limits and clear of obstacles."""
        problem = IkProblem(robot.q, robot.kinematics, robot.sent, ActuatorTask(xi), Posture(robot.q), "free")
        return _tracking(self._method.solve(problem), None, np.zeros(6), False)

    def carry(
        self,
        goal: Any,
        linear: float,
        angular: float,
        robot: Measured,
        limits: TeleoperationConfig,
        speed_scale: float = 1.0,
    ) -> Tracking:
        """One period with the tool at a fixed pose while the base moves, as far as the arm allows.

        Args:
            goal: T_odom_tool wanted (pin.SE3).
            linear: Forward velocity of the base (m/s).
            angular: Yaw rate of the base (rad/s).
            robot: Measured robot.
            limits: Of tool and base.
            speed_scale: Share of the tool's speed to use.
        """
        rate = np.zeros(len(robot.q))
        heading = float(robot.q[2])
        rate[:3] = linear * math.cos(heading), linear * math.sin(heading), angular
        return self._towards(goal, Posture(robot.q, rate), robot, "row", limits, speed_scale)

    def seek(
        self, goal: Any, q_goal: Array, robot: Measured, limits: TeleoperationConfig, speed_scale: float = 1.0
    ) -> Tracking:
        """One period towards a pose that may move (teleoperation): proportional, with bounded linear and angular speed.

        Args:
            goal: T_odom_tool wanted (pin.SE3).
            q_goal: Configuration (12) with the desired heading and arm posture.
            robot: Measured robot.
            limits: Of tool and base, and the base's role.
            speed_scale: Share of the tool's speed to use.
        """
        posture = q_goal.copy()
        posture[:2] = robot.q[:2]
        return self._towards(goal, Posture(posture), robot, limits.base, limits, speed_scale)

    def _towards(
        self,
        goal: Any,
        posture: Posture,
        robot: Measured,
        base: BaseMode,
        limits: TeleoperationConfig,
        speed_scale: float,
    ) -> Tracking:
        error = tool_error(robot.kinematics.T_odom_tool, goal)
        twist = self._gains * error
        bounds = speed_scale * limits.speed, speed_scale * limits.turn
        for part, bound in zip((slice(0, 3), slice(3, 6)), bounds, strict=True):
            size = _length(twist[part])
            if size > bound:
                twist[part] *= bound / size
        problem = IkProblem(
            robot.q,
            robot.kinematics,
            robot.sent,
            ToolTask(twist, keep_path=False),
            posture,
            base,
            bounds[0],
            wheel_cap=limits.base_speed,
        )
        return _tracking(self._method.solve(problem), goal, error, False)


def _tracking(out: Solution, desired: Any, error: Array, done: bool) -> Tracking:
    vx, vy, vz, wx, wy, wz = error.tolist()
    position, rotation = math.hypot(vx, vy, vz), math.hypot(wx, wy, wz)
    return Tracking(out.xi, desired, position, rotation, out.manipulability, out.feasible, out.reason, done, out.scale)


#: Limits of a motion of the arm's joints (rad/s, rad/s², rad/s³).
_HOMING = Rates(0.6, 1.0, 10.0)


class ArmMotion:
    """A motion of the arm's joints with the base still, all joints in the same time."""

    def __init__(self, config: MotionConfig, start: Array, goal: Array) -> None:
        """Plan from one posture (7) to another (7)."""
        self._start, self._span = start, goal - start
        self._gain = config.gain_position
        self._law = quickest(float(np.abs(self._span).max()), _HOMING)
        self.duration, self.time = self._law.duration, 0.0

    @property
    def done(self) -> bool:
        """True when the clock has reached the end."""
        return self.time >= self.duration

    def step(self, robot: Measured, follower: Follower, dt: float) -> Tracking:
        """One period of `dt` (s). Limits of the joints slow the motion's clock."""
        progress = self._law.progress(self.time)
        xi = np.zeros(NXI)
        xi[ARM_XI] = self._span * progress.rate + self._gain * (self._start + self._span * progress.s - robot.q[ARM_Q])
        tracking = follower.jog(xi, robot)
        self.time += dt * tracking.scale
        return tracking


def tool_error(T_odom_tool: Any, T_odom_goal: Any) -> Array:
    """Twist (6, odom's axes, at the tool) that takes the tool to the goal in one second: the SE(3) logarithm."""
    error = np.empty(6)
    _turned(T_odom_tool.rotation, pin.log6(T_odom_tool.actInv(T_odom_goal)).vector, error)
    return error


@compiled(NOTHING(VECTOR, VECTOR, NUMBER, MATRIX, MATRIX, VECTOR, NUMBER, NUMBER, VECTOR, VECTOR, VECTOR))
def _command_twist(
    wanted: Array,
    acceleration: Array,
    scale: float,
    J: Array,
    J_before: Array,
    sent: Array,
    lag: float,
    dt: float,
    gains: Array,
    error: Array,
    twist: Array,
) -> None:
    """Twist = ẋ_d + K e + τ (ẍ_d − J̇ ξ̇): a lead by the servos' time constant, so that they follow without delay.

    Args:
        wanted: ẋ_d (6).
        acceleration: Its rate at full speed (6), which counts with `scale`.
        scale: Rate of the motion's clock.
        J: J_ξ now (6×9).
        J_before: J_ξ a period ago (6×9).
        sent: ξ̇ (9).
        lag: τ (s).
        dt: Period (s).
        gains: K (6).
        error: e (6).
        twist: Written (6).
    """
    for i in range(6):
        drift = 0.0
        for j in range(9):
            drift += (J[i, j] - J_before[i, j]) * sent[j] / dt
        twist[i] = wanted[i] + gains[i] * error[i] + lag * (scale * acceleration[i] - drift)


@compiled(NOTHING(MATRIX, VECTOR, VECTOR))
def _turned(R: Array, screw: Array, twist: Array) -> None:
    """Both halves of a screw (6), turned by R (3×3) and written into twist (6)."""
    for i in range(3):
        for half in (0, 3):
            twist[half + i] = R[i, 0] * screw[half] + R[i, 1] * screw[half + 1] + R[i, 2] * screw[half + 2]


def nearest_about_y(T_odom_tool: Any, T_odom_goal: Any) -> Any:
    """The goal (pin.SE3) turned about its own y axis until its orientation is nearest to the tool's."""
    M = T_odom_goal.rotation.T @ T_odom_tool.rotation
    angle = math.atan2(M[0, 2] - M[2, 0], M[0, 0] + M[2, 2])
    return pin.SE3(T_odom_goal.rotation @ pin.exp3(np.array([0.0, angle, 0.0])), T_odom_goal.translation)


def _length(vector: Array) -> float:
    """Euclidean length, in a tenth of the time that numpy.linalg.norm takes."""
    return math.sqrt(float(vector @ vector))


#: A motion that is blocked without a break for this time (s) has timed out.
_HELD_S = 3.0
#: Below this rate the clock of a motion counts as stopped.
_STANDS = 0.02


class MotionTimeout:
    """Timeout of one motion at a time. Call `begin` at its start and `note` with the tracking of each period."""

    def __init__(self, timeout_s: float, dt: float) -> None:
        """Wait so long past a motion's planned end.

        Args:
            timeout_s: Beyond two and a half times the planned duration (s).
            dt: Control period (s).
        """
        self._timeout_s, self._dt = timeout_s, dt
        self.start(0.0)

    def start(self, duration: float) -> None:
        """A new motion of this planned duration (s)."""
        self._duration = duration
        self.again()

    def again(self) -> None:
        """Restart the timeout of the same motion."""
        self._started: float | None = None
        self._held_s = 0.0

    def note(self, tracking: Tracking) -> None:
        """How the motion was followed in this period."""
        held = bool(tracking.reason) and tracking.scale < _STANDS and not tracking.done
        self._held_s = self._held_s + self._dt if held else 0.0

    def over(self, tracking: Tracking, now: float, near: float, turn: float = 0.2) -> bool:
        """Whether the motion has run out and the tool is in place, to `near` (m) and `turn` (rad)."""
        if self._started is None:
            self._started = now
        return tracking.done and tracking.position_error <= near and tracking.rotation_error <= turn

    def late(self, now: float) -> bool:
        """Whether the motion has timed out: it is blocked, or far past its planned end."""
        if self._held_s > _HELD_S:
            return True
        return self._started is not None and now - self._started > 2.5 * self._duration + self._timeout_s


#: What holds the robot where nothing is named.
UNNAMED: Final = "an obstacle"


def missed(goal: reasons.Goal, tracking: Tracking) -> Reason:
    """The remaining error of a motion to `goal`, and its cause."""
    left = 1e3 * tracking.position_error, float(np.degrees(tracking.rotation_error))
    if tracking.reason:
        return reasons.not_reached_for(goal, *left, tracking.reason)
    return reasons.not_reached(goal, *left)
