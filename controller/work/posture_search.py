"""Tool poses of a cut, and the search for a posture: base position along the row, approach azimuth, arm posture.

Everything is in map, where the row stands still.

The blade plane is square to the cane, and the approach is from the side of the robot.

The search is a generator that yields after each iteration, so that a control period runs a few iterations only.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain, pairwise, product
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from controller.config import HierarchyConfig, WorkConfig
from controller.motion.surroundings import Surroundings, WorkPlace
from controller.whole_body.collision import CollisionModel, Pair
from controller.whole_body.collision_geometry import BLADES
from controller.whole_body.obstacle import Axes, Obstacle
from controller.work.point_queue import PointQueue, Ticket
from controller.work.tries import Approach, Line, Tried
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.perception import Capsule, Obstacles, PruningPoint
from rolling_panda.messages.types import CutKind, Reason, Vector3
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.transport.inbox import Received

#: An approach this close to the cane's direction is undefined.
_LEAST_SINE = 0.2
#: Distance of two poses of the straight way in that are checked (m).
_APART = 0.02


@dataclass(frozen=True)
class CutPoses:
    """The poses of the tool (pin.SE3) of one cut, on one line: `clear` of the canes, `stand_off`, and the `cut`."""

    clear: Any
    stand_off: Any
    cut: Any

    @property
    def way(self) -> tuple[Any, Any, Any]:
        """The three in the order of the way in."""
        return self.clear, self.stand_off, self.cut

    @property
    def between(self) -> tuple[Any, ...]:
        """Poses of the straight way from the stand-off to the cut, both left out, `_APART` apart."""
        start, end = self.stand_off.translation, self.cut.translation
        count = math.ceil(math.dist(start, end) / _APART)
        return tuple(pin.SE3(self.cut.rotation, start + (end - start) * number / count) for number in range(1, count))


def cut_poses(
    position: Array,
    tangent: Array,
    towards_row: Array,
    stand_off: float,
    clearance: float,
    azimuth: float = 0.0,
    tilt: float = 0.0,
    lean: float = 0.0,
) -> CutPoses:
    """The poses of a cut.

    Args:
        position: Point on the cane's axis (3, m, map).
        tangent: Unit vector along the cane (3, map), either sense.
        towards_row: Horizontal unit vector from the robot's path to the row (3, map).
        stand_off: Distance back from the cut (m).
        clearance: Distance back where the tool is clear of the canes (m).
        azimuth: Turn of the approach about the cane (rad); 0 is closest to `towards_row`.
        tilt: Turn of the tool out of the plane square to the cane (rad); positive comes from below.
        lean: Turn of the blades about the approach (rad).

    Raises:
        InputError: The cane points at the robot, so that no approach is square to it.
    """
    axis = tangent / np.linalg.norm(tangent)
    flat = towards_row - axis * float(axis @ towards_row)
    length = float(np.linalg.norm(flat))
    if length < _LEAST_SINE:
        raise InputError("the cane points straight at the robot: no approach is square to it")
    # The tool's y axis points down, so that the camera sits above the blades.
    down = -axis if axis[2] >= 0.0 else axis
    approach = pin.exp3(axis * azimuth) @ (flat / length)
    side = np.cross(down, approach)
    rotation = np.column_stack([side, down, approach])
    if tilt:
        rotation = pin.exp3(side * tilt) @ rotation
        approach = rotation[:, 2]
    if lean:
        rotation = pin.exp3(approach * lean) @ rotation

    def back(distance: float) -> Any:
        return pin.SE3(rotation, position - distance * approach)

    return CutPoses(back(clearance), back(stand_off), back(0.0))


def escape_pose(config: WorkConfig, T_odom_tool: Any, frame: MapFrame, deeper: float) -> Any | None:
    """The tool pose after a straight retreat from the canes, with the same orientation; None clear of them.

    The retreat is along the tool's own axis where that leads away from the row, else square to the row.

    Args:
        config: Where the row is, and the clearance from its canes.
        T_odom_tool: Of the tool (pin.SE3).
        frame: Where odom is in map.
        deeper: The tool may be so much nearer to the row than the clearance (m).
    """
    T_map_tool = frame.pose_in_map(T_odom_tool)
    towards_row = np.array([-np.sin(config.row_heading), np.cos(config.row_heading), 0.0])
    depth = float(T_map_tool.translation @ towards_row) - (config.row_distance - config.clearance) - deeper
    if depth <= 0.0:
        return None
    back = -T_map_tool.rotation[:, 2]
    away = -float(back @ towards_row)
    direction, cosine = (back, away) if away > 0.5 else (-towards_row, 1.0)
    return frame.pose_in_odom(pin.SE3(T_map_tool.rotation, T_map_tool.translation + direction * (depth / cosine)))


#: Positions of the cut ahead of the axle (m), in order of preference.
OFFSETS = (0.15, 0.05, 0.25, -0.05, 0.35, -0.15, 0.45)
#: Approaches in order of preference. A cut may lean by 15° (spur-pruning practice); coming from below brings high
#: points into reach, and either way passes a wire.
APPROACHES: tuple[Approach, ...] = (
    (0.0, 0.0, 0.0),
    (0.0, 0.2, 0.0),
    (0.0, 0.26, 0.0),
    (0.0, -0.26, 0.0),
    (0.35, 0.0, 0.0),
    (-0.35, 0.0, 0.0),
    (0.35, 0.2, 0.0),
    (-0.35, 0.2, 0.0),
    (0.7, 0.0, 0.0),
    (-0.7, 0.0, 0.0),
)
#: Tilts for an azimuth set by a person (rad), in order of preference.
TILTS = (0.0, 0.2, 0.26, -0.26)
#: Where none of these has room: turns, tilts and leans in all combinations, the smallest first. The blades lean to pass
#: a cane that stays, as a person's shears do: a slanting cut is usual between nodes, and on two-year wood more so.
_TURNS, _TILTS = (0.0, 0.35, 0.7), (0.0, 0.13, 0.26)
_LEANS, _STUB_LEANS = (0.0, 0.13, 0.26, 0.4, 0.55), (0.0, 0.2, 0.4, 0.6, 0.8)
#: Places of a cut along its wood in order of preference (m), as far as its point allows them.
_ALONG = (0.0, 0.0025, -0.0025, 0.005, -0.005, 0.007)
#: Farther places on the canes of a Guyot vine, where a long stub does no harm (m).
_FARTHER = (0.015, 0.025, 0.04)
#: An approach that differs from a tried one by this is another one (rad), and room beside a cane that was met which is
#: enough (m): how far canes lean and swing, and what the map may err.
_ANOTHER, _ENOUGH = 0.2, 0.03
#: Room of the tool on the way in beside canes that would give way (m), which is enough: with less another approach is
#: preferred, which may be slower and pass wires more closely.
_BESIDE_ENOUGH = 0.003
#: Room that a place farther along the wood has to bring, as a share of that distance.
_WORTH = 0.5
#: Most postures that are tried for a cut that is seen elsewhere than planned: the robot waits for them.
_FITS = 12
#: Largest distance from the arm's shoulder to its wrist, with elbow and wrist offsets (m, Panda), and from the
#: wrist to the flange (m).
_ARM_LENGTH, _WRIST_TO_FLANGE = 0.3266 + 0.3928 + 0.088, 0.107
_SHOULDER_HEIGHT = 0.333
#: Largest distance of the tool from a straight line where the joints take it out of the canes (m).
_STRAY = 0.05
_GOOD_MARGIN, _GOOD_OMEGA = 0.25, 0.035
_LEAST_MARGIN, _LEAST_OMEGA = 0.08, 0.012
#: A way by joints that brings the tool nearer to the row by less than this leads away from it (m).
_NO_NEARER = 0.005
_ITERATIONS, _LARGEST_STEP, _PULL = 45, 0.25, 0.02
_DAMPING = np.eye(6) * 1e-4


@cache
def approaches(azimuth: float | None, kind: CutKind) -> tuple[Approach, ...]:
    """All approaches in the order in which they are tried.

    Args:
        azimuth: Turn about the cane set by a person; None leaves it to the search.
        kind: What the cut is for.
    """
    usual = APPROACHES if azimuth is None else tuple((azimuth, tilt, 0.0) for tilt in TILTS)
    turns = _both(_TURNS) if azimuth is None else (azimuth,)
    leans = _both(_STUB_LEANS if kind in ("renewal cut", "removal") else _LEANS)
    more = sorted(product(turns, _both(_TILTS), leans), key=lambda each: abs(each[0]) / 2 + abs(each[1]) + abs(each[2]))
    return usual + tuple(each for each in more if each not in usual)


def places(point: PruningPoint) -> tuple[float, ...]:
    """Where a cut may be made along its wood (m past the point), the point itself first."""
    steps = (*_ALONG, *_FARTHER) if point.kind in ("cane cut", "removal") else _ALONG
    return tuple(along for along in steps if -point.inward <= along <= point.outward)


def _approaches_of(tried: Sequence[Tried]) -> list[Approach]:
    """Approaches that have failed."""
    return [each.approach for each in tried if each.approach is not None]


def _both(sizes: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(sorted({sign * size for size in sizes for sign in (1.0, -1.0)}))


@dataclass(frozen=True)
class CutPlan:
    """A reachable cut, in map unless it is said to be in odom.

    Attributes:
        poses: Tool poses of the cut.
        q_clear: Configuration (12) at `poses.clear`.
        q_stand_off: Configuration (12) at the stand-off.
        q_cut: Configuration (12) at the cut, with the base pose of the stand-off.
        joint_margin: Smallest distance to a joint limit along the approach (rad).
        manipulability: Smallest ω of the arm along the approach.
        approach: From where it is.
        along: How far past the point the cut is made, along its tangent (m), as there is no room at the point.
    """

    poses: CutPoses
    q_clear: Array
    q_stand_off: Array
    q_cut: Array
    joint_margin: float
    manipulability: float
    approach: Approach = (0.0, 0.0, 0.0)
    along: float = 0.0

    def in_odom(self, frame: MapFrame) -> "CutPlan":
        """The plan in odom of one in map."""
        if frame.T_map_level is None:
            return self
        poses = CutPoses(*map(frame.pose_in_odom, self.poses.way))
        q_clear, q_stand_off, q_cut = map(frame.configuration_in_odom, (self.q_clear, self.q_stand_off, self.q_cut))
        return replace(self, poses=poses, q_clear=q_clear, q_stand_off=q_stand_off, q_cut=q_cut)


@dataclass(frozen=True)
class Unreachable:
    """No posture was found, for a reason."""

    reason: Reason


@dataclass(frozen=True)
class Fitted:
    """A plan at the place where a close-up has seen its cut.

    Attributes:
        plan: The plan; None where no approach has room.
        lacking: What the planned cut lacks there; None where it is taken.
    """

    plan: CutPlan | None
    lacking: Reason | None


@dataclass(frozen=True)
class _Posture:
    q: Array
    margin: float
    omega: float


@dataclass
class _PassedOver:
    """What a search has passed over.

    Attributes:
        near: What was too near, by how much (m).
        tight: Ways of the tool on which open blades would push canes: their room, and where along the wood (m);
            approach and poses.
        narrow: Ways that lack only what a plan has to spare: how much; the rest as of `tight`.
    """

    near: list[tuple[float, Reason]] = field(default_factory=list)
    tight: list[tuple[float, float, Approach, CutPoses]] = field(default_factory=list)
    narrow: list[tuple[float, float, Approach, CutPoses]] = field(default_factory=list)


class PostureSearch:
    """Searches cut plans. It has its own robot model, so that a search can be suspended while control runs."""

    def __init__(self, robot: RobotModel, config: WorkConfig, joint_margin: float, clearance: "CutClearance") -> None:
        """Remember the model and the row's direction.

        Args:
            robot: Model of its own.
            config: The row and the usual postures.
            joint_margin: Distance from every joint limit (rad).
            clearance: What is known to stand around; only plans that keep clear of it are returned.
        """
        self._robot, self._config, self._clearance = robot, config, clearance
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
        self, point: PruningPoint, q: Array, azimuth: float | None = None, tried: Sequence[Tried] = ()
    ) -> Generator[None, None, CutPlan | Unreachable]:
        """Search, yielding once an iteration.

        Args:
            point: The cut.
            q: Current configuration (12, map): the base keeps its distance to the row.
            azimuth: Turn of the approach about the cane (rad) set by a person; None leaves it to the search.
            tried: Failed tries: another approach is found, with room beside the canes that were met.
        """
        passed = _PassedOver()
        for along in places(point):
            found = yield from self._find_at(along, point, q, azimuth, tried, passed)
            if found is not None:
                return found
            # Another place helps where something is in the way, not where the arm does not get there.
            if not passed.near and not passed.tight:
                return Unreachable(self._beyond(np.array(point.position), q))
        for _, along, approach, poses in sorted(passed.tight, key=lambda each: _WORTH * abs(each[1]) - each[0]):
            if (plan := (yield from self._best(poses, approach, point, q, passed))) is not None:
                return replace(plan, along=along)
        if not passed.near:
            return Unreachable(self._beyond(np.array(point.position), q))
        # Better slowly past something than not at all.
        for _, along, approach, poses in sorted(passed.narrow, key=lambda each: each[0]):
            if (plan := (yield from self._best(poses, approach, point, q, passed, spare=False))) is not None:
                return replace(plan, along=along)
        return Unreachable(reasons.no_clear_posture(min(passed.near, key=lambda each: each[0])[1]))

    def _find_at(
        self,
        along: float,
        point: PruningPoint,
        q: Array,
        azimuth: float | None,
        tried: Sequence[Tried],
        passed: "_PassedOver",
    ) -> Generator[None, None, CutPlan | Unreachable | None]:
        """Search at one place along the wood.

        Returns:
            None without a plan there that pushes no cane; `passed` then holds the obstacles.
        """
        tangent = np.array(point.tangent)
        position = np.array(point.position) + along * tangent
        usual = len(APPROACHES if azimuth is None else TILTS)
        wanted = approaches(azimuth, point.kind)
        if failed := _approaches_of(tried):
            wanted = yield from self._others(wanted, failed, tried, position, tangent)
            usual = len(wanted)
        for number, approach in enumerate(wanted):
            # More approaches help where something is in the way, not where the arm does not get there.
            if number == usual and not passed.near and not passed.tight:
                break
            try:
                poses = self._poses(position, tangent, approach)
            except InputError:
                return Unreachable(reasons.no_square_approach())
            lacking, nearest = self._clearance.tool_too_near(poses, point)
            if nearest is not None:
                passed.near.append((lacking, nearest))
                if lacking <= _SPARE and self._clearance.tool_too_near(poses, point, spare=False)[1] is None:
                    passed.narrow.append((lacking, along, approach, poses))
                yield
                continue
            yield
            if (room := self._clearance.beside(poses, point)) < _BESIDE_ENOUGH:
                passed.tight.append((room, along, approach, poses))
                yield
                continue
            # A good posture with the straight approach is preferred to a better one from the side.
            if (plan := (yield from self._best(poses, approach, point, q, passed))) is not None:
                return replace(plan, along=along)
        return None

    def fit(
        self,
        plan: CutPlan,
        point: PruningPoint,
        seen: Array,
        azimuth: float | None = None,
        tried: Sequence[Tried] = (),
        others: bool = True,
    ) -> Generator[None, None, "Fitted"]:
        """The plan of a cut where a close-up has seen it, with the base where the plan has it.

        The planned approach is taken where it has room there, or beside it along the wood, else the one nearest to it
        that has. The errors of map and arm often shift all wood alike. So no cane that stays may be between the
        closing blades where the cut is seen, nor where it is in the map.

        Args:
            plan: The plan.
            point: The cut as accepted.
            seen: Where the close-up has seen it (3, m, map).
            azimuth: Turn of the approach about the cane (rad) set by a person; None leaves it to the search.
            tried: Failed tries, whose approaches are not taken again.
            others: False allows no other approach than the planned one.
        """
        known, tangent = np.array(point.position), np.array(point.tangent)
        in_map = known + tangent * float((seen - known) @ tangent)
        lacking: Reason | None = None
        left = _FITS
        wanted = self._nearest(plan.approach, point, azimuth, tried) if others else [plan.approach]
        beside = yield from self._along_with_room(plan, point, (seen, in_map))
        usual = [(approach, along, approach != plan.approach) for approach, along in product(wanted, beside)]
        # Other approaches that lack only what a plan has to spare, after those that lack nothing.
        narrow: list[tuple[Approach, float, bool]] = []
        for approach, along, spare in chain(usual, narrow):
            shift = along * tangent
            poses = self._poses(seen + shift, tangent, approach)
            lack, why = self._clearance.tool_too_near(poses, point, spare)
            if spare and 0.0 < lack <= _SPARE:
                narrow.append((approach, along, False))
            why = why or self._clearance.bitten(self._poses(in_map + shift, tangent, approach).cut, point)
            yield
            if why is None:
                left -= 1
                found = yield from self._try(poses, plan.q_stand_off, plan.q_stand_off[ARM_Q])
                if found is None:
                    why = self._beyond(seen, plan.q_cut)
                else:
                    why = self._clearance.too_near(found, point, spare)[1]
                if found is not None and why is None:
                    return Fitted(replace(found, approach=approach, along=along), lacking)
                yield
            lacking = lacking or why
            if left == 0:
                break
        return Fitted(None, lacking)

    def _along_with_room(
        self, plan: CutPlan, point: PruningPoint, where: tuple[Array, ...]
    ) -> Generator[None, None, list[float]]:
        """Places along the wood (m), those first where open blades on the planned approach push no cane.

        Args:
            plan: The plan.
            point: The cut.
            where: Places where the cut may be (3, m, map).
        """
        room: dict[float, float] = {}
        for along in places(point):
            shift = along * np.array(point.tangent)
            at = [self._poses(each + shift, np.array(point.tangent), plan.approach) for each in where]
            room[along] = min(self._clearance.beside(poses, point) for poses in at)
            yield
        return sorted(room, key=lambda each: _WORTH * abs(each - plan.along) - min(room[each], _BESIDE_ENOUGH))

    def _nearest(
        self, planned: Approach, point: PruningPoint, azimuth: float | None, tried: Sequence[Tried]
    ) -> list[Approach]:
        """The planned approach, and the others in the order of their distance from it."""
        others = {
            each
            for each in approaches(azimuth, point.kind)
            if each != planned and all(math.dist(each, one) >= _ANOTHER for one in _approaches_of(tried))
        }
        return [planned, *sorted(others, key=lambda each: (math.dist(each, planned), each))]

    def _best(
        self,
        poses: CutPoses,
        approach: Approach,
        point: PruningPoint,
        q: Array,
        passed: "_PassedOver",
        spare: bool = True,
    ) -> Generator[None, None, CutPlan | None]:
        """The first good plan with an approach, else the best one. Adds obstacles to `passed`."""
        config, position = self._config, poses.cut.translation
        best: CutPlan | None = None
        lateral = float(np.array([q[0], q[1], 0.0]) @ self._left)
        for offset in OFFSETS:
            place = (float(position @ self._along) - offset) * self._along + lateral * self._left
            start = q.copy()
            start[:3] = place[0], place[1], config.row_heading
            if self._too_far(poses.cut, start):
                continue
            for seed in (np.array(config.reach), np.array(config.home)):
                plan = yield from self._try(poses, start, seed)
                if plan is None:
                    continue
                plan = replace(plan, approach=approach)
                lacking, nearest = self._clearance.too_near(plan, point, spare)
                if nearest is not None:
                    passed.near.append((lacking, nearest))
                    continue
                if plan.joint_margin >= _GOOD_MARGIN and plan.manipulability >= _GOOD_OMEGA:
                    return plan
                if best is None or _quality(plan) > _quality(best):
                    best = plan
        return best

    def _beyond(self, position: Array, q: Array) -> Reason:
        """That no posture reaches a place from the line on which the base drives."""
        lateral = float(np.array([q[0], q[1], 0.0]) @ self._left)
        return reasons.out_of_reach(float(position @ self._left) - lateral, float(position[2]))

    def _poses(self, position: Array, tangent: Array, approach: Approach) -> CutPoses:
        config = self._config
        return cut_poses(position, tangent, self._left, config.stand_off, config.clearance, *approach)

    def _others(
        self,
        wanted: Sequence[Approach],
        failed: Sequence[Approach],
        tried: Sequence[Tried],
        position: Array,
        tangent: Array,
    ) -> Generator[None, None, tuple[Approach, ...]]:
        """Those that are others than the failed ones: with the most room beside the canes that were met first."""
        met = [each.cane for each in tried if each.cane is not None]
        room: dict[Approach, float] = {}
        for approach in wanted:
            if min(math.dist(approach, each) for each in failed) < _ANOTHER:
                continue
            try:
                poses = self._poses(position, tangent, approach)
            except InputError:
                break
            room[approach] = min(self._clearance.tool_room(poses, met), _ENOUGH) if met else _ENOUGH
            yield
        return tuple(sorted(room, key=lambda each: -room[each]))

    def _too_far(self, goal: Any, q: Array) -> bool:
        """Whether the stretched arm would not get there, which saves most of a vain search."""
        T_odom_base = self._robot.pose(q, self._base_id)
        shoulder = T_odom_base.act(self._shoulder)
        wrist = goal.translation - (self._tool_length + _WRIST_TO_FLANGE) * goal.rotation[:, 2]
        return float(np.linalg.norm(wrist - shoulder)) > _ARM_LENGTH

    def arm_at(self, goal: Any, q: Array, *postures: Array) -> Array | None:
        """A configuration (12) with the tool at a pose and the base where it is, far enough from singularities.

        On the way there by joints the tool comes off a straight line by 50 mm at most. A vain search takes some 10 ms.

        Args:
            goal: Of the tool (pin.SE3), in the frame of q.
            q: Configuration (12).
            postures: Of the arm (7, rad), from which one is sought in turn.

        Returns:
            None where none is found.
        """
        for posture in postures:
            start = q.copy()
            start[ARM_Q] = posture
            found = completed(self._solve(start, goal, posture))
            good = found is not None and found.margin >= _LEAST_MARGIN and found.omega >= _LEAST_OMEGA
            if found is not None and good and self._strays(q, found.q) <= _STRAY:
                return found.q
        return None

    def tenable(self, q: Array) -> bool:
        """Whether an arm (of 12) is as far from joint limits and singularities as that of every plan."""
        reached = self._posture(q, self._robot.kinematics(q).J[:, ARM_Q])
        return reached.margin >= _LEAST_MARGIN and reached.omega >= _LEAST_OMEGA

    def leads_away(self, q: Array, goal: Array, frame: MapFrame) -> bool:
        """Whether the tool comes no nearer to the row while the joints go from one configuration to another (12)."""
        depth = [float(frame.position_in_map(place) @ self._left) for place in self._way(q, goal)]
        return max(depth) <= depth[0] + _NO_NEARER

    def _way(self, q: Array, goal: Array) -> Array:
        """Places of the tool (N×3, m) while the joints go from one configuration to another."""
        shares = np.linspace(0.0, 1.0, 11)
        return np.array([self._robot.kinematics(q + share * (goal - q)).T_odom_tool.translation for share in shares])

    def _strays(self, q: Array, goal: Array) -> float:
        """How far the tool comes off a straight line while the joints go from one configuration to another (m)."""
        way = self._way(q, goal)
        line = (way[-1] - way[0]) / max(float(np.linalg.norm(way[-1] - way[0])), 1e-9)
        return float(np.linalg.norm(way - way[0] - np.outer((way - way[0]) @ line, line), axis=1).max())

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
        for _ in range(_ITERATIONS):
            k = self._robot.kinematics(q)
            error = np.empty(6)
            error[:3] = goal.translation - k.T_odom_tool.translation
            error[3:] = pin.log3(goal.rotation @ k.T_odom_tool.rotation.T)
            J = k.J[:, ARM_Q]
            if float(np.abs(error[:3]).max()) < 2e-4 and float(np.abs(error[3:]).max()) < 2e-3:
                return self._posture(q, J)
            pull = _PULL * (posture - q[ARM_Q])
            step = pull + J.T @ np.linalg.solve(J @ J.T + _DAMPING, error - J @ pull)
            largest = float(np.abs(step).max())
            if largest > _LARGEST_STEP:
                step *= _LARGEST_STEP / largest
            q[ARM_Q] = np.clip(q[ARM_Q] + step, self._lower, self._upper)
            yield
        return None

    def _posture(self, q: Array, J: Array) -> _Posture:
        """A configuration (12) with its arm's distance from limits and singularities, by its Jacobian (6×7)."""
        arm, limits = q[ARM_Q], self._robot.limits
        margin = float(np.minimum(arm - limits.lower[ARM_Q], limits.upper[ARM_Q] - arm).min())
        return _Posture(q, margin, float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0))))


def _quality(plan: CutPlan) -> float:
    return min(plan.joint_margin / _GOOD_MARGIN, 1.0) + min(plan.manipulability / _GOOD_OMEGA, 1.0)


_Result = TypeVar("_Result")


def completed(search: Generator[None, None, _Result]) -> _Result:
    """Result of a search, run to its end at once."""
    while True:
        try:
            next(search)
        except StopIteration as end:
            found: _Result = end.value
            return found


#: Distance kept from everything where the tool is clear of the canes (m).
CLEARANCE = 0.02
#: Margin above the smallest distance of the guard (m): close to it the robot is very slow. Just before the way in less
#: is enough, as nothing changes any more.
_ROOM, _LEAST_ROOM = 0.003, 0.001
_SPARE = _ROOM - _LEAST_ROOM
#: Axes of canes (m).
Polylines = tuple[tuple[Vector3, ...], ...]
#: Canes this near to a cut may be beside the tool on its way in (m).
_AROUND = 0.3
#: Radius of a cane of which only the axis is told, and distance from the bark up to which a cut is on it (m).
_THIN, _OWN = 0.005, 0.015
#: By so much a posture may miss a pose (m).
_INEXACT = 0.0005
#: Half sizes of the space between the open blades along the tool's axes (m): opening, thickness and reach.
_BLADES = np.array([0.015, 0.0025, 0.018])
#: A cane is between the closing blades where its axis comes into that space with a margin for where it was seen (m).
_BITE = _BLADES + [0.005, 0.0015, 0.004]
#: No cane farther from the middle of a cut than this (m) comes into that box, with what its bark hides.
_BESIDE = 0.05
#: What is known of a cane begins at the bark of its stub, up to so far from the stub's axis (m).
_HIDDEN = 0.020


class CutClearance:
    """Checks cut plans before their execution. It has its own robot model, like the posture search."""

    def __init__(self, robot: RobotModel, settings: HierarchyConfig) -> None:
        """Nothing is known to stand around yet."""
        self._settings = settings
        self._surroundings = Surroundings(CollisionModel(robot))
        self._within = max(settings.collision_distance + _ROOM, CLEARANCE)
        self._lines: Polylines = ()
        self._axes, self._line_of = Axes(()), np.zeros(0, dtype=int)

    def update(self, obstacles: Received[Obstacles] | None, canes: Polylines = ()) -> None:
        """Take the newest messages; what was taken before costs nothing.

        Args:
            obstacles: What stands around.
            canes: Axes of all standing canes, with those that will be cut off (polylines, m, map).
        """
        self._surroundings.update(obstacles)
        if canes is not self._lines:
            self._lines = canes
            pieces = [(number, *ends) for number, line in enumerate(canes) for ends in pairwise(line)]
            self._axes = Axes(tuple(Obstacle("", "cane", start, end, _THIN) for _, start, end in pieces))
            self._line_of = np.array([number for number, _, _ in pieces], dtype=int)

    def too_near(self, plan: CutPlan, point: PruningPoint, spare: bool = True) -> tuple[float, Reason | None]:
        """Largest violation of a required distance (m), with its place and parts; None without one.

        Places: at the cut, at the stand-off and clear of the canes. The blades may touch the wood that is cut.

        Args:
            plan: The plan.
            point: The cut.
            spare: Whether it has the room of a plan, beyond what the guard needs on the way.
        """
        if not self._settings.collisions:
            return 0.0, None
        self._surroundings.work_at((WorkPlace.of(plan.poses.cut.translation, point),))
        places: tuple[tuple[reasons.Place, Array], ...] = (
            ("at the cut", plan.q_cut),
            ("at the stand-off", plan.q_stand_off),
            ("clear of it", plan.q_clear),
        )
        near: list[tuple[reasons.Place, float, Pair]] = []
        for where, q in places:
            found = self._surroundings.model.distances(q, self._within)
            near += [(where, *each) for each in zip(found.distance.tolist(), found.pairs, strict=True)]
        return self._lacking(near, spare)

    def tool_too_near(self, poses: CutPoses, point: PruningPoint, spare: bool = True) -> tuple[float, Reason | None]:
        """The same of the tool alone, which no posture of the arm changes, all along its way in.

        A cane that stays, or may stay, must not be between the blades either, nor a wire, post, trunk or cordon, though
        they would pass it open; of last year's cane the piece may that is removed.

        Args:
            poses: Of the tool.
            point: The cut.
            spare: As of `too_near`.
        """
        if not self._settings.collisions:
            return 0.0, None
        self._surroundings.work_at((WorkPlace.of(poses.cut.translation, point),))
        places: tuple[tuple[reasons.Place, Any], ...] = (
            ("at the cut", poses.cut),
            *(("on the way in", pose) for pose in poses.between),
            ("at the stand-off", poses.stand_off),
            ("clear of it", poses.clear),
        )
        found = self._surroundings.model.tool_distances([pose for _, pose in places], self._within)
        near = [(places[at][0], float(distance), pair) for distance, at, pair in zip(*found, strict=True)]
        worst = max(self._taken(poses.cut, point), self._lacking(near, spare, _INEXACT), key=lambda each: each[0])
        return self._jamming(poses.cut, point) if worst[1] is None else worst

    def tool_room(self, poses: CutPoses, axes: Sequence[Line]) -> float:
        """Least distance of the tool from some canes on its way into a cut (m); infinite from the cane that is cut."""
        canes = Axes(tuple(Obstacle("", "cane", start, end, _THIN) for start, end in axes))
        own = canes.gaps(poses.cut.translation[None], np.zeros(1))[0] < _OWN
        gaps = self._surroundings.model.tool_gaps(poses.way, canes)
        return float(np.where(own, np.inf, gaps).min())

    def beside(self, poses: CutPoses, point: PruningPoint) -> float:
        """Least distance of the tool, with open blades, from standing canes on its way into a cut (m).

        Canes that will be cut off count too, but for the one that is cut, or those that fall with a stub; so do canes
        that the blades may push aside, and the cane that stays on a stub: so near to its base it hardly bends. Beside
        last year's cane all of them count. A cane between the blades has none.
        """
        cut = poses.cut.translation
        old_wood = point.kind in ("renewal cut", "removal")
        near = self._surroundings.canes_near(cut, _AROUND) if old_wood else ()
        staying = Axes(tuple(obstacle for capsule, obstacle in near if not _is_cut(capsule, point)))
        room = float(self._surroundings.model.tool_gaps((*poses.between, poses.cut), staying).min(initial=math.inf))
        gaps = self._axes.gaps(cut[None], np.zeros(1))[0]
        own = set[int]() if point.kind == "removal" else set(self._line_of[gaps < _OWN].tolist())
        if own and point.kind != "renewal cut":
            own = {int(self._line_of[int(np.argmin(gaps))])}
        others = np.flatnonzero((gaps < _AROUND) & ~np.isin(self._line_of, list(own)))
        canes = self._axes.part(others)
        gaps_of_tool = self._surroundings.model.tool_gaps((*poses.between, poses.cut), canes)
        room = min(room, float(gaps_of_tool.min(initial=math.inf)))
        for number in np.flatnonzero(gaps[others] < _BESIDE).tolist():
            inside, _ = _in_box((canes.ends(number) - cut) @ poses.cut.rotation)
            if inside > 0.0:
                room = min(room, -inside)
        return room

    def _lacking(
        self, near: Sequence[tuple[reasons.Place, float, Pair]], spare: bool, inexact: float = 0.0
    ) -> tuple[float, Reason | None]:
        """Largest violation of a required distance of pairs at places; `inexact` is forgiven (m)."""
        worst, found = 0.0, None
        for where, distance, pair in near:
            needed = self._settings.kept(pair) + (_ROOM if spare else _LEAST_ROOM)
            if where == "clear of it" and spare:
                # The motion to the next cut begins and ends here.
                needed = max(needed, CLEARANCE)
            if needed - inexact - distance > worst:
                worst = needed - inexact - distance
                found = reasons.too_near(where, 1e3 * distance, *pair, 1e3 * needed)
        return worst, found

    def bitten(self, T_map_tool: Any, point: PruningPoint) -> Reason | None:
        """What the closing blades would bite on at a pose besides the cut; None where there is nothing.

        Canes that stay, and wires, posts, trunks and cordons but for the piece that is removed: open blades may pass on
        either side of them.
        """
        if not self._settings.collisions:
            return None
        return self._taken(T_map_tool, point)[1] or self._jamming(T_map_tool, point)[1]

    def _taken(self, T_map_tool: Any, point: PruningPoint) -> tuple[float, Reason | None]:
        """A cane that the blades would cut as well at a pose: how far it is in (m), and the reason."""
        worst, found = 0.0, None
        canes = self._surroundings.canes_near(T_map_tool.translation, _BESIDE)
        joints = {cane.end for cane, _ in canes}
        for capsule, cane in canes:
            if _is_cut(capsule, point):
                continue
            start, end = np.array(cane.start), np.array(cane.end)
            if cane.start not in joints:
                start = start - _HIDDEN * (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
            inside, away = _in_box((np.array([start, end]) - T_map_tool.translation) @ T_map_tool.rotation)
            if inside > worst:
                near = reasons.too_near("at the cut", 1e3 * away, BLADES, cane.name, 1e3 * (away + inside))
                worst, found = inside, near
        return worst, found

    def _jamming(self, T_map_tool: Any, point: PruningPoint) -> tuple[float, Reason | None]:
        """A hard part that the blades would close on at a pose: how much of a distance it lacks (m), and the reason."""
        worst, found = 0.0, None
        for rigid in self._surroundings.rigid_near(WorkPlace.of(T_map_tool.translation, point), _BESIDE):
            gap = _gap_between_blades(rigid, T_map_tool)
            if _LEAST_ROOM - gap > worst:
                worst = _LEAST_ROOM - gap
                found = reasons.too_near("at the cut", 1e3 * gap, BLADES, rigid.name, 1e3 * _LEAST_ROOM)
        return worst, found


def _is_cut(cane: Capsule, point: PruningPoint) -> bool:
    """Whether a cane is the one that is cut at a point; of a cut on a stub, one that goes with the stub.

    A removal cuts none of the spur beside last year's cane.
    """
    if (cane.vine, cane.spur) != (point.vine, point.spur) or point.kind == "removal":
        return False
    known = cane.cane >= 0 and point.cane >= 0
    if point.kind == "renewal cut":
        return known and cane.cane != point.cane
    return not known or cane.cane == point.cane


def _in_box(ends: Array) -> tuple[float, float]:
    """How far a line segment (2×3, in the tool's frame) is in the box of the closing blades, and from its middle (m).

    Zero and infinity where it does not come into it.
    """
    along = np.where(np.abs(ends[1] - ends[0]) < 1e-9, 1e-9, ends[1] - ends[0])
    first, second = (-_BITE - ends[0]) / along, (_BITE - ends[0]) / along
    low, high = max(float(np.minimum(first, second).max()), 0.0), min(float(np.maximum(first, second).min()), 1.0)
    if low >= high:
        return 0.0, math.inf
    places = ends[0] + np.linspace(low, high, 9)[:, None] * along
    inside = np.minimum(_BITE[0] - np.abs(places[:, 0]), _BITE[2] - np.abs(places[:, 2]))
    deepest = int(np.argmax(inside))
    return float(inside[deepest]), float(np.hypot(places[deepest, 0], places[deepest, 2]))


def _gap_between_blades(obstacle: Obstacle, T_map_tool: Any) -> float:
    """Distance of an obstacle from the space between the open blades at a pose (m), negative where it is in it."""
    start, end = np.array(obstacle.start), np.array(obstacle.end)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start).toRotationMatrix()
    capsule = pin.coal.Capsule(obstacle.radius, float(np.linalg.norm(end - start)))
    at_capsule, at_blades = pin.coal.Transform3s(turn, (start + end) / 2), pin.coal.Transform3s()
    at_blades.setTransform(T_map_tool.rotation, T_map_tool.translation)
    space = pin.coal.Box(*(2.0 * _BLADES).tolist())
    request, result = pin.coal.DistanceRequest(), pin.coal.DistanceResult()
    return float(pin.coal.distance(capsule, at_capsule, space, at_blades, request, result))


Found = CutPlan | Unreachable | None
Known = Callable[[Ticket], Found]
Permit = Callable[[Ticket], Reason | None]


class NextCut:
    """Posture search for the next point. Call `search` for a point and `step` in each period; `found` is the result."""

    def __init__(
        self,
        search: PostureSearch,
        queue: PointQueue,
        iterations: int,
        known: Known = lambda _: None,
        permit: Permit = lambda _: None,
    ) -> None:
        """Start without a point.

        Args:
            search: Posture search.
            queue: The queue, which chooses the next point.
            iterations: Iterations of the search in one period.
            known: Gives the planned cut of a point, which is then used without a search.
            permit: Gives the reason why the robot may not approach a point; None if it may.
        """
        self._search, self._queue, self._iterations, self._known = search, queue, iterations, known
        self.permit = permit
        #: Reason why the robot may not approach the next point; None without one.
        self.refused: Reason | None = None
        self.forget()

    def forget(self) -> None:
        """Drop the point and its search."""
        self._ticket: Ticket | None = None
        self._finding: Generator[None, None, CutPlan | Unreachable] | None = None
        self.found: CutPlan | Unreachable | None = None

    @property
    def point_id(self) -> str:
        """Id of the point; empty without one."""
        return "" if self._ticket is None else self._ticket.point.point_id

    @property
    def accepted(self) -> PruningPoint | None:
        """The point as accepted, which the plan is for; None without one."""
        return None if self._ticket is None else self._ticket.accepted

    def search(self, q: Array) -> bool:
        """Search for the next accepted point from configuration q (12, map), unless its search is under way.

        Returns:
            False when no point is accepted, or the next one may not be gone to.
        """
        ticket = self._queue.next()
        self.refused = None if ticket is None else self.permit(ticket)
        if ticket is None or ticket.accepted is None or self.refused:
            self.forget()
            return False
        if not self.stands:
            self._ticket, self.found, self._finding = ticket, self._known(ticket), None
            if self.found is not None:
                return True
            azimuth = self._queue.approaches.of(ticket.point.point_id)
            tried = self._queue.tries.of(ticket.point.point_id)
            self._finding = self._search.find(ticket.accepted, q, azimuth, tried)
        return True

    @property
    def stands(self) -> bool:
        """Whether the point is still the next one, with the same acceptance."""
        ticket, following = self._ticket, self._queue.next()
        return ticket is not None and following is not None and following.accepted is ticket.accepted

    def step(self) -> None:
        """Search for one period."""
        for _ in range(self._iterations):
            if self._finding is None:
                return
            try:
                next(self._finding)
            except StopIteration as end:
                self.found, self._finding = end.value, None
