"""Method `decoupled`: drive, stop, then reach. The baseline of the comparisons.

First the base turns towards the posture's goal, drives there and turns to the goal's heading. The arm rests and the
motion's clock waits. Then the base rests and the arm alone moves the tool, by the damped pseudo-inverse of `nullspace`.
The limits are those of the other methods.
"""

import math

import numpy as np
from msgspec.structs import replace

from controller.config import WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import IkProblem, Solution
from rolling_panda.model.differential_drive import NXI
from rolling_panda.model.robot import RobotModel

#: Tolerances of the base's goal: along and across (m), heading (rad). The arm compensates the rest.
_NEAR, _TURNED = 0.02, 0.02
#: Heading error above which the base turns on the spot (rad).
_ASTRAY = 0.15
_GAIN, _DRIVE_GAIN = 2.0, 4.0
#: Tolerance of the posture's base pose (m).
_ARRIVED = 1e-3


class Decoupled:
    """Base first, arm second, never both."""

    name = "decoupled"
    flows = False

    def __init__(self, robot: RobotModel, config: WholeBodyConfig, dt: float) -> None:
        """Bind the parts for a control period of `dt` (s)."""
        self._config = config
        self._arm = Nullspace(robot, config, dt)
        self._saturation = Saturation(robot, config, dt)
        self._wheels = Actuation(robot.drive).wheels

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        reach = self._arm.solve(replace(problem, base="frozen"))
        goal = problem.posture.goal
        if problem.base == "frozen" or goal is None or not problem.finite:
            return reach
        v, omega = self._drive(problem, float(goal[0]), float(goal[1]), float(goal[2]))
        driving = v != 0.0 or omega != 0.0
        still = not problem.sent[:2].any()
        if not driving and still and not problem.posture.rate[:2].any():
            return reach
        wanted = np.zeros(NXI)
        wanted[:2] = self._wheels @ (v, omega)
        limited = self._saturation.apply(wanted, problem.q, problem.sent)
        # The clock advances with the tool's motion by the base, but not beyond the base's remaining motion.
        ahead = math.hypot(float(goal[0] - problem.posture.q[0]), float(goal[1] - problem.posture.q[1])) > _ARRIVED
        return Solution(limited.xi, float(ahead or still and not driving), reach.manipulability)

    def _drive(self, problem: IkProblem, x: float, y: float, phi: float) -> tuple[float, float]:
        """Forward speed and yaw rate towards a base pose; both 0 at it."""
        config = self._config
        dx, dy = x - float(problem.q[0]), y - float(problem.q[1])
        c, s = math.cos(float(problem.q[2])), math.sin(float(problem.q[2]))
        ahead, aside = c * dx + s * dy, c * dy - s * dx
        distance = math.hypot(dx, dy)
        if distance > _NEAR:
            # Forwards or backwards, whichever needs less turning.
            way = 1.0 if ahead >= 0.0 else -1.0
            astray = math.atan2(way * aside, way * ahead)
            omega = max(-config.base_yaw_rate, min(config.base_yaw_rate, _GAIN * astray))
            if abs(astray) > _ASTRAY:
                return 0.0, omega
            braking = math.sqrt(config.base_acceleration * distance)
            return way * min(config.base_speed, braking, _DRIVE_GAIN * distance), omega
        turn = math.remainder(phi - float(problem.q[2]), math.tau)
        if abs(turn) > _TURNED:
            return 0.0, max(-config.base_yaw_rate, min(config.base_yaw_rate, _GAIN * turn))
        return 0.0, 0.0
