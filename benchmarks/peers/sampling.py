"""Planners of OMPL for the arm with the base at rest, over the robot's own capsules."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.control.arm_path import ArmPath
from benchmarks.control.plan_limits import PlanLimits
from controller.whole_body.collision import CollisionModel
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q

#: OMPL's planners by our names; the second one goes on improving until its time is over.
OMPL = {"rrt_connect": "RRTConnect", "aorrtc": "AORRTC"}
#: Largest joint step between two collision checks (rad), as `ArmPathPlanner` has it.
_LOOK = 0.02


class OmplPlanner:
    """A planner of OMPL, its path simplified by OMPL. `find` has `ArmPathPlanner`'s question."""

    def __init__(self, name: str, collision: CollisionModel, limits: PlanLimits, seconds: float, seed: int = 0) -> None:
        """Bind the collision model.

        Args:
            name: One of `OMPL`.
            collision: Of robot and obstacles.
            limits: Joint limits and clearance.
            seconds: Longest search (s).
            seed: Of all samples; OMPL takes the first one of a process.

        Raises:
            RollingPandaError: OMPL is not installed.
        """
        try:
            from ompl import base, geometric, util
        except ImportError as error:
            raise RollingPandaError(f"OMPL is not installed ({error}); `make peers` installs it") from error
        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(seed + 1)
        self._base, self._geometric = base, geometric
        self._name, self._collision, self._limits, self._seconds = name, collision, limits, seconds

    def find(self, q: Array, goal: Array) -> ArmPath | None:
        """A way from the configuration q (12) to the arm posture `goal` (7), the base standing as in q, or None."""
        lower, upper = np.minimum(self._limits.lower, q[ARM_Q]), np.maximum(self._limits.upper, q[ARM_Q])
        space = self._base.RealVectorStateSpace(7)
        bounds = self._base.RealVectorBounds(7)
        for joint in range(7):
            bounds.setLow(joint, float(lower[joint]))
            bounds.setHigh(joint, float(upper[joint]))
        space.setBounds(bounds)
        setup = self._geometric.SimpleSetup(space)
        setup.setStateValidityChecker(self._clear(q))
        information = setup.getSpaceInformation()
        # OMPL measures by the Euclidean norm, which is never less than the largest joint's step.
        information.setStateValidityCheckingResolution(_LOOK / space.getMaximumExtent())
        information.setup()
        start, end = space.allocState(), space.allocState()
        for joint in range(7):
            start[joint], end[joint] = float(q[ARM_Q][joint]), float(goal[joint])
        # Where the straight line is free AORRTC of OMPL 2.0.1 loses the start.
        if information.checkMotion(start, end):
            return ArmPath(np.array([q[ARM_Q], goal]))
        setup.setStartAndGoalStates(start, end)
        setup.setPlanner(getattr(self._geometric, OMPL[self._name])(information))
        setup.solve(self._seconds)
        if not setup.haveExactSolutionPath():
            return None
        setup.simplifySolution()
        return ArmPath(
            np.array([[state[joint] for joint in range(7)] for state in setup.getSolutionPath().getStates()])
        )

    def _clear(self, q: Array) -> Callable[[Any], bool]:
        place = q.copy()

        def clear(state: Any) -> bool:
            place[ARM_Q] = [state[joint] for joint in range(7)]
            return self._collision.least(place).distance >= self._limits.clearance

        return clear
