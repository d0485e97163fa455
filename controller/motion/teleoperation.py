"""Hold-to-run teleoperation."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import TeleoperationConfig, WorkConfig
from controller.identity import Client
from controller.motion.follower import Follower, Measured, Tracking
from rolling_panda.errors import ModelError
from rolling_panda.messages.supervision import ArmAngles, BaseVelocity, TeleopTarget, ToolVelocity
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import NXI, Array, DifferentialDrive
from rolling_panda.model.robot import ARM_Q, ARM_XI, placement
from rolling_panda.transport.inbox import Received

#: Delay of the view up to which the speed is full, and from which it is the lowest (s).
_PROMPT_S, _LATE_S, _SLOWEST = 0.25, 0.5, 0.25


#: Gain of the way to a posture (1/s), and how far the goal runs ahead of the tool (m, rad).
_POSTURE_GAIN, _LEAD_M, _LEAD_RAD = 3.0, 0.06, 0.2


@dataclass
class _Course:
    """A motion along an axis: where it began, the axes in odom (3×3), and its time at full speed so far (s)."""

    velocity: ToolVelocity
    start: Any
    axes: Array
    passed_s: float = 0.0

    def at(self) -> Any:
        """T_odom_tool there (pin.SE3)."""
        way, turn = (
            self.passed_s * self.axes @ np.array(part) for part in (self.velocity.linear, self.velocity.angular)
        )
        return pin.SE3(pin.exp3(turn) @ self.start.rotation, self.start.translation + way)


class Teleoperation:
    """Checks the hold and follows its target. After any other end than its release a hold has to be pressed again."""

    def __init__(
        self,
        config: TeleoperationConfig,
        work: WorkConfig,
        follower: Follower,
        drive: DifferentialDrive,
        dt: float,
        refusal: Callable[[Array, Array], Reason | None],
        tool_refusal: Callable[[Any, Any], Reason | None],
    ) -> None:
        """Bind the parts for a control period of `dt` (s).

        Args:
            config: Limits of motion by hand.
            work: Has the row's direction and the posture that the arm tends to.
            follower: Follows what is wanted.
            drive: Geometry of the base.
            dt: Control period (s).
            refusal: Why the arm cannot go to a posture (7, rad) from a configuration (12); None if it can.
            tool_refusal: Why the tool cannot go to a pose from another one (pin.SE3 both); None if it can.
        """
        self._config, self._follower, self._drive = config, follower, drive
        self._dt, self._refusal, self._tool_refusal = dt, refusal, tool_refusal
        self._course: _Course | None = None
        self._checked: ArmAngles | None = None
        self._goal_checked = False
        self._posture: Array = np.concatenate([[0.0, 0.0, work.row_heading, 0.0, 0.0], work.reach])
        self._newest: Received[TeleopTarget] | None = None
        self._message: TeleopTarget | None = None
        self._goal: Any = None
        self.pressed = True
        self.client = Client("", "")

    def holding(self, teleop: Received[TeleopTarget] | None, now: float) -> bool:
        """Whether the operator holds: the newest target is fresh, held and valid."""
        newest = self._newest_target(teleop)
        if newest is None or not newest.message.hold or now - newest.at > self._config.hold_max_age_s:
            self.pressed = True
            self._course = self._checked = None
            self._goal_checked = False
            return False
        message = newest.message
        if message is not self._message:
            self._message, self._goal = message, None
            if message.target is not None:
                try:
                    self._goal = placement(message.target)
                except ModelError:
                    self._message = None
        self.client = Client(message.client or message.user, message.user)
        return self._message is not None and _means_something(message)

    def _newest_target(self, teleop: Received[TeleopTarget] | None) -> Received[TeleopTarget] | None:
        """The newest target by its number. Late or repeated ones are ignored.

        After a timeout has ended the hold any number is accepted, because a restarted server counts from one.
        """
        last = self._newest
        if teleop is not None and (
            last is None
            or teleop.message.sequence > last.message.sequence
            or teleop.at - last.at > self._config.hold_max_age_s
        ):
            self._newest = teleop
        return self._newest

    def refuse(self) -> None:
        """Void the current hold; it has to be released first."""
        self.pressed = False

    def refused(self, robot: Measured) -> Reason | None:
        """Why the arm cannot go to the held posture, or the tool to the pose that a hold begins with; None if it can.

        While a hold lasts, the tool slides along what its target is led into.
        """
        if self._goal is not None and not self._goal_checked:
            self._goal_checked = True
            return self._tool_refusal(self._goal, robot.kinematics.T_odom_tool)
        posture = None if self._message is None else self._message.posture
        if posture is None or posture == self._checked:
            return None
        why = self._refusal(np.array(posture), robot.q)
        if why is None:
            self._checked = posture
        return why

    def step(self, robot: Measured) -> Tracking:
        """One period of the held motion."""
        message, xi = self._message, np.zeros(NXI)
        if message is None:
            return self._follower.jog(xi, robot)
        speed_scale = message.speed_scale * latency_speed_scale(message.round_trip_s)
        base = None if message.base is None else self._driven(message.base, speed_scale)
        if self._goal is not None:
            if base is None:
                return self._follower.seek(self._goal, self._posture, robot, self._config, speed_scale)
            return self._follower.carry(self._goal, *base, robot, self._config, speed_scale)
        if base is not None:
            xi[:2] = self._drive.wheels(*base)
        elif message.joints is not None:
            xi[ARM_XI] = speed_scale * np.array(message.joints)
        elif message.posture is not None:
            xi[ARM_XI] = self._towards(np.array(message.posture) - robot.q[ARM_Q], speed_scale)
        elif message.along is not None:
            goal = self._along(message.along, robot, speed_scale)
            return self._follower.seek(goal, self._posture, robot, self._config, speed_scale)
        return self._follower.jog(xi, robot)

    def _towards(self, left: Array, speed_scale: float) -> Array:
        """Velocities of the joints (7, rad/s) for the angles left (7, rad): straight, and slower at the end."""
        rates = _POSTURE_GAIN * left
        fastest, bound = float(np.abs(rates).max()), self._config.joint_speed * speed_scale
        slowed: Array = rates if fastest <= bound else rates * (bound / fastest)
        return slowed

    def _along(self, velocity: ToolVelocity, robot: Measured, speed_scale: float) -> Any:
        """T_odom_tool to lead the tool to: it runs ahead along the axis, as far as the tool can follow."""
        pose, course = robot.kinematics.T_odom_tool, self._course
        if course is None or course.velocity != velocity:
            base = pin.exp3(np.array([0.0, 0.0, robot.q[2]]))
            axes = {"tool": pose.rotation.copy(), "base": base, "world": np.eye(3)}[velocity.axes]
            course = self._course = _Course(velocity, pose.copy(), axes)
        goal = course.at()
        lead = pose.actInv(goal)
        length, angle = np.linalg.norm(lead.translation), np.linalg.norm(pin.log3(lead.rotation))
        if length < _LEAD_M and angle < _LEAD_RAD:
            end = np.inf if velocity.duration_s is None else velocity.duration_s
            course.passed_s = min(course.passed_s + self._dt * speed_scale, end)
        return course.at()

    def _driven(self, base: BaseVelocity, speed_scale: float) -> tuple[float, float]:
        """Forward velocity (m/s) and yaw rate (rad/s), slowed alike until no wheel is too fast to brake in time."""
        fastest = abs(base.linear) + abs(base.angular) * self._drive.half_track
        scale = speed_scale * min(1.0, self._config.base_speed / fastest) if fastest > 0.0 else 0.0
        return scale * base.linear, scale * base.angular


def latency_speed_scale(round_trip_s: float) -> float:
    """Speed scale by the delay of the operator's view: 1 up to 0.25 s, 0.25 from 0.5 s on."""
    slow = (round_trip_s - _PROMPT_S) / (_LATE_S - _PROMPT_S)
    return 1.0 - (1.0 - _SLOWEST) * min(max(slow, 0.0), 1.0)


def _means_something(message: TeleopTarget) -> bool:
    """Either a tool target or a base velocity or both, or one of the other motions alone."""
    tool_or_base = message.target is not None or message.base is not None
    return tool_or_base + sum(each is not None for each in (message.joints, message.along, message.posture)) == 1
