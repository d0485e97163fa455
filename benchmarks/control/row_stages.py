"""Where the time of a cut goes: what the robot was doing in each control period, and what kept it from being faster."""

import math
from dataclasses import dataclass, field

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import Tracking
from rolling_panda.config import RobotConfig
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_XI, RobotModel
from tests.support.worlds.closed_loop import ClosedLoop

#: Stages in the order of a cut.
STAGES = ("standing", "transfer", "close-up", "advance", "slow", "settle", "blades", "retreat")
#: What may hold the motion back; `plan` where it runs at the pace it was planned with.
LIMITS = (
    "plan",
    "slow zone",
    "joint velocity",
    "joint acceleration",
    "base velocity",
    "base acceleration",
    "speed cap, distances or balance",
)
#: A clock at less than this rate is held back; a velocity at this share of its bound is at it.
_HELD, _AT = 0.98, 0.99


@dataclass
class StageClock:
    """Adds up simulated seconds by stage and, while the tool is on its way, by what limits it.

    Attributes:
        config: Of the controller.
        stages: Seconds by stage.
        limits: Seconds by limit, over transfer, advance, slow and retreat; before a close-up the camera is waited for.
    """

    config: ControllerConfig
    stages: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    limits: dict[str, float] = field(default_factory=lambda: dict.fromkeys(LIMITS, 0.0))

    def __post_init__(self) -> None:
        """Look up the limits once."""
        robot = RobotModel(RobotConfig())
        self._dt = 1.0 / self.config.rate_hz
        self._radius = robot.drive.wheel_radius
        self._speed = robot.limits.velocity[ARM_XI] * self.config.whole_body.arm_velocity_scale
        self._step = robot.limits.acceleration[ARM_XI] * self.config.whole_body.arm_acceleration_scale * self._dt
        self._sent: Array = np.zeros(9)
        self._last = math.nan

    def begin(self, now: float) -> None:
        """The work begins (s, simulated)."""
        self._last = now

    def end(self, now: float) -> None:
        """The work has ended (s, simulated): what nobody accounted for, the robot stood."""
        self.stages["standing"] += max(now - self._last, 0.0)

    def note(self, loop: ClosedLoop, tracking: Tracking) -> None:
        """Take in one control period."""
        elapsed, self._last = loop.now - self._last, loop.now
        self.stages["standing"] += max(elapsed - self._dt, 0.0)
        spent = min(elapsed, self._dt)
        stage = self._stage(loop, tracking)
        self.stages[stage] += spent
        if stage in ("transfer", "advance", "slow", "retreat"):
            self.limits[self._limit(stage, tracking)] += spent
        self._sent = tracking.xi

    def _stage(self, loop: ClosedLoop, tracking: Tracking) -> str:
        state = loop.state
        phase = "" if state is None else state.phase
        if phase == "CUT":
            return "blades"
        if phase == "RETREAT":
            return "retreat"
        if phase == "CLOSE_UP":
            return "close-up"
        if phase != "ADVANCE" or state is None:
            return "transfer"
        if tracking.done:
            return "settle"
        goal = next((e.accepted_position for e in state.queue if e.point_id == state.active_point_id), None)
        near = goal is not None and math.dist(goal, tracking.desired.translation) <= self.config.motion.slow_zone
        return "slow" if near else "advance"

    def _limit(self, stage: str, tracking: Tracking) -> str:
        if tracking.scale >= _HELD:
            return "plan"
        if stage == "slow":
            return "slow zone"
        xi, change = tracking.xi, np.abs(tracking.xi - self._sent)
        if np.any(np.abs(xi[ARM_XI]) >= _AT * self._speed):
            return "joint velocity"
        if np.any(change[ARM_XI] >= _AT * self._step):
            return "joint acceleration"
        if abs(float(xi[:2].sum())) * self._radius / 2 >= _AT * self.config.whole_body.base_speed:
            return "base velocity"
        if abs(float((xi[:2] - self._sent[:2]).sum())) * self._radius / 2 >= (
            _AT * self.config.whole_body.base_acceleration * self._dt
        ):
            return "base acceleration"
        return LIMITS[-1]
