"""Tool motion segments to a cut, into the canes and out of them."""

import math
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import WorkConfig
from controller.motion.tool_motion import Leg
from controller.work.posture_search import CutPlan
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q


class ApproachSegments:
    """Segments for a method that blends them, or for one that stops between them."""

    def __init__(self, config: WorkConfig, flows: bool) -> None:
        """Bind the configuration."""
        self._config, self._flows = config, flows

    def to(self, plan: CutPlan, T_odom_tool: Any, q: Array) -> tuple[Leg, ...]:
        """Segments from a tool pose (pin.SE3) at q (12) to a cut, or to the pose of a close-up before it."""
        there = self.there(plan, T_odom_tool, q)
        return there if self._config.pre_cut_check else (*there, self.into(plan))

    def there(self, plan: CutPlan, T_odom_tool: Any, q: Array) -> tuple[Leg, ...]:
        """From a pose of the tool (pin.SE3) at q (12) to clear of the canes before a cut."""
        speed = self._config.tool_speed
        if self._flows:
            return (Leg(plan.poses.clear, plan.q_clear, speed),)
        # The base moves with the arm at rest; then the arm moves alone.
        q_there = at_base(q, plan.q_clear)
        carried = _base_pose(q_there) * _base_pose(q).inverse() * T_odom_tool
        return Leg(carried, q_there, speed), Leg(plan.poses.clear, plan.q_clear, speed, math.inf)

    def into(self, plan: CutPlan) -> Leg:
        """Straight in, from clear of the canes to the cut."""
        config = self._config
        return Leg(plan.poses.cut, plan.q_cut, config.advance_speed, config.arm_only if self._flows else math.inf)

    def out(self, plan: CutPlan, q: Array) -> Leg:
        """Straight back, from the cut to clear of the canes with the base at q (12)."""
        arm_only = self._config.arm_only if self._flows else math.inf
        return Leg(plan.poses.clear, at_base(plan.q_clear, q), self._config.tool_speed, frozen_until=arm_only)


def at_base(q_arm: Array, q_base: Array) -> Array:
    """The arm posture of one configuration (12) with the base of another."""
    out = q_base.copy()
    out[ARM_Q] = q_arm[ARM_Q]
    return out


def _base_pose(q: Array) -> Any:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, q[2]])), np.array([q[0], q[1], 0.0]))
