"""Saved postures of the arm: named by people, kept in the ledger. Goals are checked before the arm goes to one."""

from typing import Any

import numpy as np

from controller.config import WholeBodyConfig, WorkConfig
from controller.ledger.journal import Journal, PostureRow
from controller.motion.body import Body
from controller.motion.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import GROUND, TOOL
from controller.whole_body.obstacle import Axes
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import Handlers
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.supervision import ArmAngles, SavedPosture
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.transport.inbox import Received

#: Most saved postures: every state of the controller lists them. Longest name.
MOST, LONGEST = 20, 40


#: The tool is deeper inside something than it is now by more than this (m).
_DEEPER = 0.001
#: Distance of the spheres that stand for a part of the tool (m).
_APART = 0.005


class PostureCheck:
    """Whether arm or tool can be somewhere while the base stands where it does. It has its own robot model."""

    def __init__(self, robot: RobotModel, config: WholeBodyConfig) -> None:
        """Nothing is known to stand around yet."""
        self._settings = config.hierarchy
        limits = robot.limits
        self._low = limits.lower[ARM_Q] + config.joint_margin
        self._high = limits.upper[ARM_Q] - config.joint_margin
        self._surroundings = Surroundings(CollisionModel(robot))
        self._spheres = _tool_spheres(robot, self._surroundings.model)

    def update(self, obstacles: Received[Obstacles] | None) -> None:
        """Take the newest message; one that was taken before costs nothing."""
        self._surroundings.update(obstacles)

    def refusal(self, posture: Array, q: Array) -> Reason | None:
        """Why the arm cannot go to a posture; None if it can.

        Args:
            posture: Of the arm (7, rad).
            q: Where the robot is (12).
        """
        for joint, (angle, low, high) in enumerate(zip(posture, self._low, self._high, strict=True), 1):
            if not low <= angle <= high:
                return reasons.posture_out_of_range(joint, *(float(np.degrees(each)) for each in (angle, low, high)))
        there = q.copy()
        there[ARM_Q] = posture
        settings = self._settings
        near = self._surroundings.model.distances(there, settings.collision_distance)
        for distance, pair in zip(near.distance.tolist(), near.pairs, strict=True):
            if distance < settings.kept(pair):
                return reasons.posture_touches(1e3 * distance, *pair, 1e3 * settings.kept(pair))
        return None

    def tool_refusal(self, goal: Any, now: Any) -> Reason | None:
        """Why the tool cannot go to a pose, whatever the posture: it would be inside something; None if it can.

        Canes do not count, as they give way, nor does something that the tool is as deep in already.

        Args:
            goal: T_odom_tool wanted (pin.SE3).
            now: T_odom_tool measured (pin.SE3).
        """
        parts, centers, radii = self._spheres
        obstacles = [each for each in self._surroundings.model.obstacles if each.kind != "cane"]
        axes, others = Axes(tuple(obstacles)), (GROUND, *(each.name for each in obstacles))
        there, here = (
            np.column_stack([points[:, 2] - radii, axes.gaps(points, radii)])
            for points in (centers @ T.rotation.T + T.translation for T in (goal, now))
        )
        inside = np.where(there < np.minimum(here, 0.0) - _DEEPER, there, 0.0)
        row, column = np.unravel_index(int(inside.argmin()), inside.shape)
        if inside[row, column] == 0.0:
            return None
        return reasons.tool_inside(parts[row], others[column], -1e3 * float(inside[row, column]))


def _tool_spheres(robot: RobotModel, model: CollisionModel) -> tuple[tuple[str, ...], Array, Array]:
    """Spheres that fill the tool's capsules: part, middle in the tool's frame (n×3, m) and radius of each (n, m)."""
    q, shapes = np.zeros(12), model.shapes
    T_tool_odom = robot.pose(q, robot.tool_id).inverse()
    parts: list[str] = []
    centers, radii = list[Array](), list[float]()
    for part, half, around, placed in zip(shapes.parts, shapes.half, shapes.around, model.placed(q), strict=True):
        if part not in TOOL:
            continue
        axis, middle = placed[:9].reshape(3, 3)[:, 2], placed[9:]
        for along in np.linspace(-half[2], half[2], max(2, int(2.0 * half[2] / _APART) + 1)):
            parts.append(part)
            centers.append(T_tool_odom.act(middle + along * axis))
            radii.append(float(around))
    return tuple(parts), np.array(centers), np.array(radii)


class Postures:
    """The saved postures. Those of the program come first and stay."""

    def __init__(self, config: WorkConfig, body: Body, check: PostureCheck, journal: Journal) -> None:
        """Only the program's own are known; later ones are recorded in `journal`."""
        self._body, self._check, self._journal = body, check, journal
        self._own = (SavedPosture("survey", config.home), SavedPosture("folded", config.folded))
        self._saved: dict[str, SavedPosture] = {}
        self.all: tuple[SavedPosture, ...] = self._own

    def handlers(self) -> Handlers:
        """The handler of each command about postures."""
        return {
            intents.SavePosture: lambda asked, _: self.save(asked.posture, asked.user),
            intents.DeletePosture: lambda asked, _: self.delete(asked.posture, asked.user),
            intents.CheckPosture: lambda asked, _: self.check(asked.angles),
        }

    def restore(self, rows: tuple[tuple[str, PostureRow], ...]) -> None:
        """Restore the state of an earlier start."""
        for name, row in rows:
            self._put(name, row)

    def save(self, name: str, user: str) -> Reason | None:
        """Save the measured posture under a name. Returns the reason of a refusal; None if done."""
        name, measured = name.strip(), self._body.measured
        if not name:
            return reasons.posture_name_empty()
        if len(name) > LONGEST:
            return reasons.posture_name_long(len(name), LONGEST)
        if name.casefold() in {each.name.casefold() for each in self.all}:
            return reasons.posture_name_taken(name)
        if len(self._saved) >= MOST:
            return reasons.postures_full(MOST)
        if measured is None:
            return reasons.posture_unmeasured()
        row = PostureRow(angles=_rounded(measured.q[ARM_Q]), user=user)
        self._put(name, row)
        self._journal.add("posture", name, row)
        return None

    def delete(self, name: str, user: str) -> Reason | None:
        """Delete a saved posture. Returns the reason of a refusal; None if done."""
        if name not in self._saved:
            return reasons.posture_not_saved(name)
        row = PostureRow(angles=None, user=user)
        self._put(name, row)
        self._journal.add("posture", name, row)
        return None

    def check(self, angles: ArmAngles) -> Reason | None:
        """Why the arm cannot go there from where the robot is; None if it can."""
        measured = self._body.measured
        if measured is None:
            return reasons.posture_unmeasured()
        return self._check.refusal(np.array(angles), measured.q)

    def _put(self, name: str, row: PostureRow) -> None:
        if row.angles is None:
            self._saved.pop(name, None)
        else:
            self._saved[name] = SavedPosture(name, row.angles, row.user)
        self.all = (*self._own, *self._saved.values())


def _rounded(angles: Array) -> ArmAngles:
    """To 0.0001 rad: every state lists them."""
    a, b, c, d, e, f, g = np.round(angles, 4).tolist()
    return (a, b, c, d, e, f, g)
