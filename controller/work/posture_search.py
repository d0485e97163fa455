"""Posture search for a cut: base position along the row, approach azimuth and arm posture.

The search is a generator that yields after each iteration, so that a control period runs a few iterations only.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import WorkConfig
from controller.work.cut_pose import CutPoses, cut_poses
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

#: Positions of the cut ahead of the axle (m), in order of preference.
OFFSETS = (0.15, 0.05, 0.25, -0.05, 0.35, -0.15, 0.45)
#: Approaches in order of preference: turn about the cane and tilt out of the plane square to it (rad). A cut may lean
#: by 15° (spur-pruning practice); coming from below brings high points into reach, and either way passes a wire.
APPROACHES = (
    (0.0, 0.0),
    (0.0, 0.2),
    (0.0, 0.26),
    (0.0, -0.26),
    (0.35, 0.0),
    (-0.35, 0.0),
    (0.35, 0.2),
    (-0.35, 0.2),
    (0.7, 0.0),
    (-0.7, 0.0),
)
#: Tilts for an azimuth set by a person (rad), in order of preference.
TILTS = (0.0, 0.2, 0.26, -0.26)
#: Largest distance from the arm's shoulder to its wrist, with elbow and wrist offsets (m, Panda), and from the
#: wrist to the flange (m).
_ARM_LENGTH, _WRIST_TO_FLANGE = 0.3266 + 0.3928 + 0.088, 0.107
_SHOULDER_HEIGHT = 0.333
_GOOD_MARGIN, _GOOD_OMEGA = 0.25, 0.035
_LEAST_MARGIN, _LEAST_OMEGA = 0.08, 0.012
_ITERATIONS, _LARGEST_STEP, _PULL = 45, 0.25, 0.02
_DAMPING = np.eye(6) * 1e-4


@dataclass(frozen=True)
class CutPlan:
    """A reachable cut.

    Attributes:
        poses: Tool poses of the cut.
        q_clear: Configuration (12) at `poses.clear`.
        q_stand_off: Configuration (12) at the stand-off.
        q_cut: Configuration (12) at the cut, with the base pose of the stand-off.
        joint_margin: Smallest distance to a joint limit along the approach (rad).
        manipulability: Smallest ω of the arm along the approach.
    """

    poses: CutPoses
    q_clear: Array
    q_stand_off: Array
    q_cut: Array
    joint_margin: float
    manipulability: float


@dataclass(frozen=True)
class Unreachable:
    """No posture was found, for a reason."""

    reason: Reason


@dataclass(frozen=True)
class _Posture:
    q: Array
    margin: float
    omega: float


class PostureSearch:
    """Searches cut plans. It has its own robot model, so that a search can be suspended while control runs."""

    def __init__(
        self,
        robot: RobotModel,
        config: WorkConfig,
        joint_margin: float,
        too_near: Callable[[CutPlan], tuple[float, Reason | None]] = lambda _: (0.0, None),
    ) -> None:
        """Remember the model and the row's direction.

        Args:
            robot: Model of its own.
            config: The row and the usual postures.
            joint_margin: Distance from every joint limit (rad).
            too_near: How much of a required distance a plan lacks (m), with its place and parts; None if it lacks none.
                Another plan is not returned.
        """
        self._robot, self._config, self._too_near = robot, config, too_near
        c, s = np.cos(config.row_heading), np.sin(config.row_heading)
        self._along, self._left = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
        self._base_id = robot.frame_id("base_link")
        neutral = np.zeros(12)
        mount = robot.pose(neutral, robot.frame_id("arm_mount"))
        flange, tool = robot.pose(neutral, robot.flange_id), robot.pose(neutral, robot.tool_id)
        self._shoulder = mount.translation + np.array([0.0, 0.0, _SHOULDER_HEIGHT])
        self._tool_length = float(flange.actInv(tool).translation[2])
        margin = joint_margin + 0.02
        self._lower = robot.limits.lower[ARM_Q] + margin
        self._upper = robot.limits.upper[ARM_Q] - margin

    def find(
        self, position: Array, tangent: Array, q: Array, azimuth: float | None = None
    ) -> Generator[None, None, CutPlan | Unreachable]:
        """Search, yielding once an iteration.

        Args:
            position: Position of the cut (3, m, odom).
            tangent: Unit vector along the cane (3, odom).
            q: Current configuration (12): the base keeps its distance to the row.
            azimuth: Turn of the approach about the cane (rad) set by a person; None leaves it to the search.
        """
        best: CutPlan | None = None
        passed_over: list[tuple[float, Reason]] = []
        seeds = (np.array(self._config.reach), np.array(self._config.home))
        base = np.array([q[0], q[1], 0.0])
        lateral = float(base @ self._left)
        config = self._config
        approaches = APPROACHES if azimuth is None else tuple((azimuth, tilt) for tilt in TILTS)
        for turn, tilt in approaches:
            try:
                poses = cut_poses(position, tangent, self._left, config.stand_off, config.clearance, turn, tilt)
            except InputError:
                return Unreachable(reasons.no_square_approach())
            for offset in OFFSETS:
                place = (float(position @ self._along) - offset) * self._along + lateral * self._left
                start = q.copy()
                start[:3] = place[0], place[1], config.row_heading
                if self._too_far(poses.cut, start):
                    continue
                for seed in seeds:
                    plan = yield from self._try(poses, start, seed)
                    if plan is None:
                        continue
                    lacking, nearest = self._too_near(plan)
                    if nearest is not None:
                        passed_over.append((lacking, nearest))
                        continue
                    if plan.joint_margin >= _GOOD_MARGIN and plan.manipulability >= _GOOD_OMEGA:
                        return plan
                    if best is None or _quality(plan) > _quality(best):
                        best = plan
            # A good posture with the straight approach is preferred to a better one from the side.
            if best is not None:
                return best
        if passed_over:
            return Unreachable(reasons.no_clear_posture(min(passed_over, key=lambda each: each[0])[1]))
        distance = float(position @ self._left) - lateral
        return Unreachable(reasons.out_of_reach(distance, float(position[2])))

    def _too_far(self, goal: Any, q: Array) -> bool:
        """Whether the stretched arm would not get there, which saves most of a vain search."""
        T_odom_base = self._robot.pose(q, self._base_id)
        shoulder = T_odom_base.act(self._shoulder)
        wrist = goal.translation - (self._tool_length + _WRIST_TO_FLANGE) * goal.rotation[:, 2]
        return float(np.linalg.norm(wrist - shoulder)) > _ARM_LENGTH

    def _try(self, poses: CutPoses, start: Array, seed: Array) -> Generator[None, None, CutPlan | None]:
        q = start.copy()
        q[ARM_Q] = seed
        stand_off = yield from self._solve(q, poses.stand_off, seed)
        if stand_off is None:
            return None
        # From the stand-off in both directions, like the robot's motion.
        cut = yield from self._solve(stand_off.q, poses.cut, stand_off.q[ARM_Q])
        if cut is None:
            return None
        clear = yield from self._solve(stand_off.q, poses.clear, stand_off.q[ARM_Q])
        if clear is None:
            return None
        margin = min(stand_off.margin, cut.margin, clear.margin)
        omega = min(stand_off.omega, cut.omega, clear.omega)
        if margin < _LEAST_MARGIN or omega < _LEAST_OMEGA:
            return None
        return CutPlan(poses, clear.q, stand_off.q, cut.q, margin, omega)

    def _solve(self, q: Array, goal: Any, posture: Array) -> Generator[None, None, _Posture | None]:
        """Damped least squares for the arm alone, inside its limits, pulled towards `posture` in the null space."""
        q = q.copy()
        limits = self._robot.limits
        for _ in range(_ITERATIONS):
            k = self._robot.kinematics(q)
            error = np.empty(6)
            error[:3] = goal.translation - k.T_odom_tool.translation
            error[3:] = pin.log3(goal.rotation @ k.T_odom_tool.rotation.T)
            J = k.J[:, ARM_Q]
            if float(np.abs(error[:3]).max()) < 2e-4 and float(np.abs(error[3:]).max()) < 2e-3:
                arm = q[ARM_Q]
                margin = float(np.minimum(arm - limits.lower[ARM_Q], limits.upper[ARM_Q] - arm).min())
                return _Posture(q, margin, float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0))))
            pull = _PULL * (posture - q[ARM_Q])
            step = pull + J.T @ np.linalg.solve(J @ J.T + _DAMPING, error - J @ pull)
            largest = float(np.abs(step).max())
            if largest > _LARGEST_STEP:
                step *= _LARGEST_STEP / largest
            q[ARM_Q] = np.clip(q[ARM_Q] + step, self._lower, self._upper)
            yield
        return None


def _quality(plan: CutPlan) -> float:
    return min(plan.joint_margin / _GOOD_MARGIN, 1.0) + min(plan.manipulability / _GOOD_OMEGA, 1.0)


def completed(search: Generator[None, None, CutPlan | Unreachable]) -> CutPlan | Unreachable:
    """Result of a search, run to its end at once."""
    while True:
        try:
            next(search)
        except StopIteration as end:
            found: CutPlan | Unreachable = end.value
            return found
