"""Motions of the arm out of the canes and to a survey posture, with the base at rest."""

import math
from collections.abc import Callable

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import UNNAMED, ArmMotion, Follower, Measured, MotionTimeout, Tracking
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.saturation import Saturation
from controller.work.posture_search import escape_pose
from controller.work.step_result import StepResult
from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q

#: Room between the clearance from the canes and the tool when the arm begins to turn home (m).
_ROOM = 0.03
#: Tolerance of the posture (rad).
_NEAR = 0.01
#: Rate of the clock, and time below it (s), from which the motion counts as blocked.
_HELD, _PATIENCE_S = 0.02, 1.5
#: The same for the rest of the straight way once the tool is clear of the canes: the joints turn home from there.
_SLOW = 0.05
#: Distance to the pose clear of the canes at which the next motion begins (m).
_CLEAR = 0.02


class Homing:
    """One homing motion: straight out of the canes, then by joints. Call `step` until `done`; stop calling it to stop.

    Where the straight way is blocked by the time the tool is clear of the canes, the joints turn home from there.
    """

    def __init__(self, config: ControllerConfig, follower: Follower, dt: float, posture: Array | None = None) -> None:
        """Bind the parts for a control period of `dt` (s); the goal is `posture` (7, rad), or the survey posture."""
        self._config, self._follower, self._dt = config, follower, dt
        self._goal = np.array(config.work.home) if posture is None else posture
        self._out: ToolMotion | None = None
        self._in: ArmMotion | None = None
        self._held_s = 0.0
        self.done = False
        #: What has blocked the arm; empty otherwise.
        self.blocked = ""

    def step(self, robot: Measured) -> Array:
        """One period: ξ̇ to send (9)."""
        if self._in is None:
            pose = robot.kinematics.T_odom_tool
            if self._out is None and (goal := escape_pose(self._config.work, pose, robot.frame, -_ROOM)) is not None:
                out = Leg(goal, robot.q, self._config.work.advance_speed, math.inf)
                self._out = ToolMotion(self._config.motion, self._config.whole_body, pose, robot.q, [out])
            if self._out is not None:
                tracking = self._follower.follow(self._out, robot)
                if not tracking.done or tracking.position_error > _CLEAR:
                    clear = escape_pose(self._config.work, pose, robot.frame, 0.0) is None
                    self._wait(tracking.done or tracking.scale < (_SLOW if clear else _HELD), tracking)
                    if not (self.blocked and clear):
                        return tracking.xi
                    self._held_s, self.blocked = 0.0, ""
            self._in = ArmMotion(self._config.motion, robot.q[ARM_Q].copy(), self._goal)
        tracking = self._in.step(robot, self._follower, self._dt)
        self._wait(tracking.scale < _HELD, tracking)
        self.done = self._in.done and float(np.abs(robot.q[ARM_Q] - self._goal).max()) < _NEAR
        return tracking.xi

    def _wait(self, held: bool, tracking: Tracking) -> None:
        """Give up when something has held the arm for long enough."""
        self._held_s = self._held_s + self._dt if held else 0.0
        if self._held_s > _PATIENCE_S:
            self.blocked = tracking.reason or UNNAMED


def go_home(homing: Homing, robot: Measured, saturation: Saturation, blocked: Callable[[str], Reason]) -> StepResult:
    """One period of a homing motion within automatic work; where the arm is blocked, work pauses with the reason."""
    xi = homing.step(robot)
    if homing.blocked:
        return StepResult(saturation.ramp(robot.sent), pause=blocked(homing.blocked))
    return StepResult(xi)


class Withdrawal:
    """A joint-space retreat with the base at rest: each joint goes straight to its position where the tool is clear.

    The collision guard stays on. The tool leaves the straight line: from a cut by as much as `PostureSearch.arm_at`
    allows, which chose the posture; on the way to a cut it is clear of the canes.
    """

    def __init__(self, config: ControllerConfig, follower: Follower, q: Array, q_clear: Array) -> None:
        """Plan from q (12) to the arm posture of `q_clear` (12), clear of the canes."""
        self._follower, self._dt = follower, 1.0 / config.rate_hz
        self._goal = q_clear[ARM_Q].copy()
        self._motion = ArmMotion(config.motion, q[ARM_Q].copy(), self._goal)
        self._timeout = MotionTimeout(config.work.reach_timeout_s, self._dt)
        self._timeout.start(self._motion.duration)
        #: Whether the arm has arrived, and whether the motion has failed.
        self.done = self.late = False
        self._held_by = UNNAMED

    def hold(self) -> None:
        """The robot stands for one period."""
        self._timeout.again()

    def step(self, robot: Measured, now: float) -> Tracking:
        """One period."""
        tracking = self._motion.step(robot, self._follower, self._dt)
        self._timeout.note(tracking)
        self._timeout.over(tracking, now, 0.0)
        self.done = self._motion.done and float(abs(robot.q[ARM_Q] - self._goal).max()) < _NEAR
        self.late = not self.done and self._timeout.late(now)
        self._held_by = tracking.reason or UNNAMED
        return tracking

    def missed(self, goal: reasons.Goal, robot: Measured) -> Reason:
        """By how much a joint missed `goal`, and what held the arm."""
        off = float(abs(robot.q[ARM_Q] - self._goal).max())
        return reasons.joints_not_reached(goal, float(np.degrees(off)), self._held_by)
