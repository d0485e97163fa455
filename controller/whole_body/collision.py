"""Distances between robot, ground and obstacles, and their derivatives over ξ̇.

One call of Coal, through Pinocchio, computes all distances. A broad phase selects the pairs: spheres around the robot's
parts against the obstacles' axes. `dampers` runs in every control period. It repeats the broad phase only when the
robot may have moved by `_SLACK`.

Obstacles occupy slots: capsules in the geometry model that get a size and a pose when an obstacle comes near. So
hundreds of obstacles can be replaced at run time without rebuilding Pinocchio's data.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from msgspec import Struct

from controller.whole_body.collision_geometry import (
    BLADES,
    TOOL,
    Shapes,
    add_ground,
    bounding_radius,
    part_of,
    robot_geometry,
    self_pairs,
    shapes_of,
)
from controller.whole_body.compiled import FLAG, MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.obstacle import Axes, Obstacle
from rolling_panda.errors import ControlError, InputError
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import Kinematics, RobotModel

Pair = tuple[str, str]
#: Motion of a part after which the broad phase is repeated (m).
_SLACK = 0.06
#: Number of obstacle slots. Rebuilding Pinocchio's data for more takes about 10 ms.
_SLOTS = 64
_TRANSLATING = ("JointModelPX", "JointModelPY")
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Distances:
    """Pairs below a requested distance.

    Attributes:
        distance: Of each pair (k, m), negative where they overlap.
        pairs: Names of both sides (k).
        point_a: Nearest point on the first side (k×3, m, odom).
        point_b: Nearest point on the second side (k×3, m, odom).
    """

    distance: Array
    pairs: tuple[Pair, ...]
    point_a: Array
    point_b: Array


@dataclass(frozen=True)
class Clearance:
    """The smallest distance (m) and its two parts."""

    distance: float
    pair: Pair


class Dampers(Struct, frozen=True):
    """Rates of the distances of near pairs: ḋ = normal_jacobian ξ̇.

    Attributes:
        normal_jacobian: (k×9).
        distance: (k, m).
        pairs: Names of both sides (k).
    """

    normal_jacobian: Array
    distance: Array
    pairs: tuple[Pair, ...]


class CollisionModel:
    """Collision model of the robot and the obstacles. Not thread-safe: it uses the work space of its `RobotModel`."""

    _slots: int
    _geometry: Any
    _data: Any
    _capsules: list[Any]
    _active: set[int]
    _results: list[Any]
    _normals: list[Any]
    _centers: list[Any]
    _moves: Array
    _known: list[int]
    _known_for: float
    _known_at: Array
    nearest: Clearance | None = None
    """Of what the last `dampers` found; None where nothing was near."""

    def __init__(self, robot: RobotModel) -> None:
        """Build the robot's shapes and decide by sampling which of its pairs to watch (about 0.2 s the first time)."""
        self._robot = robot
        # A view of Pinocchio's own memory.
        self._tool = robot.data.oMf[robot.tool_id]
        self._shapes = robot_geometry(robot)
        objects = self._shapes.geometryObjects
        self._parts = [part_of(item.name) for item in objects]
        self._radii = np.array([bounding_radius(item.geometry) for item in objects])
        #: How far any part moves at most for a change of q by 1 (m, 12).
        self.motion_bound = _motion_bound(robot.model, self._shapes, self._radii)
        self._support = np.array([_support(robot.model, item.parentJoint) for item in objects] + [np.zeros(NQ)])
        self._ground = add_ground(self._shapes)
        self._self_pairs = self_pairs(robot, self._shapes, self._ground)
        self._names = [(part_of(objects[a].name), part_of(objects[b].name)) for a, b in self._self_pairs]
        self._obstacles: tuple[Obstacle, ...] = ()
        self._allowed = (frozenset[str](), frozenset[str]())
        self._build(_SLOTS)
        self.set_obstacles(())
        self._tool_rows = np.flatnonzero([part in TOOL for part in self._parts])
        self._tool_ends, self._tool_radii = self._tool_capsules()

    @property
    def self_pairs(self) -> tuple[Pair, ...]:
        """Watched pairs within the robot and with the ground; a part of several shapes comes up once for each."""
        return tuple(self._names)

    @property
    def shapes(self) -> Shapes:
        """Of the robot, in the order of `placed`."""
        return shapes_of(self._shapes.geometryObjects[: len(self._parts)])

    def placed(self, q: Array) -> Array:
        """Where each part is at q (12): its rotation, row by row, and its middle, both in odom (p×12)."""
        self._place(q)
        placements = self._data.oMg[: len(self._parts)]
        return np.array([[*T.rotation.ravel(), *T.translation] for T in placements])

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The current obstacles."""
        return self._obstacles

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Replace everything that stands beside the robot.

        Raises:
            InputError: Two obstacles have the same name.
        """
        if len({obstacle.name for obstacle in obstacles}) < len(obstacles):
            raise InputError("two obstacles have the same name; each needs its own")
        self._obstacles = tuple(obstacles)
        self._axes = Axes(self._obstacles)
        self._slot_of: dict[int, int] = {}
        self._free = list(range(self._slots))
        self.allow(*self._allowed)

    def allow(self, names: Collection[str], parts: Collection[str] = (BLADES,)) -> None:
        """Let some parts of the robot touch some obstacles: the blades the cane that is being cut.

        Replaces what was allowed before; with no names nothing is. Stays when obstacles are replaced.

        Args:
            names: Of obstacles; others may come later.
            parts: Of the robot.

        Raises:
            InputError: The robot has no such part.
        """
        if unknown := set(parts) - set(self._parts):
            raise InputError(f"no part {', '.join(sorted(unknown))}; known are {', '.join(sorted(set(self._parts)))}")
        self._allowed = (frozenset(names), frozenset(parts))
        rows = np.array([part in self._allowed[1] for part in self._parts])
        columns = np.array([o.name in self._allowed[0] for o in self._obstacles], dtype=bool)
        self._ignored = rows[:, None] & columns
        self._ignores = bool(self._ignored.any())
        self._known_for = -1.0

    def distances(self, q: Array, within: float = 0.5) -> Distances:
        """Every watched pair nearer than `within` (m) at q (12), nearest first."""
        self._place(q)
        near = self._nearer(self._everything(within), within)
        near.sort(key=lambda p: self._results[p].min_distance)
        results = [self._results[p] for p in near]
        return Distances(
            np.array([result.min_distance for result in results]),
            tuple(self._pair(p) for p in near),
            np.array([result.getNearestPoint1() for result in results]).reshape(-1, 3),
            np.array([result.getNearestPoint2() for result in results]).reshape(-1, 3),
        )

    def tool_distances(self, places: Sequence[Any], within: float) -> tuple[Array, Any, tuple[Pair, ...]]:
        """Distances of the tool's parts from the obstacles with the tool at some poses, whatever the arm's posture.

        Args:
            places: Poses of the tool (pin.SE3, in odom).
            within: Farther pairs do not count (m).

        Returns:
            Distances (k, m), the number of the pose of each (k), and names of both sides (k).
        """
        gaps = self.tool_gaps(places, self._axes)
        if self._ignores:
            gaps[:, self._ignored[self._tool_rows]] = np.inf
        near = np.argwhere(gaps < within)
        pairs = [(self._parts[self._tool_rows[part]], self._obstacles[at].name) for _, part, at in near.tolist()]
        return gaps[tuple(near.T)], near[:, 0], tuple(pairs)

    def tool_gaps(self, places: Sequence[Any], axes: Axes) -> Array:
        """Distances (p×t×n, m) of the tool's parts, at p poses (pin.SE3), from the axes of n obstacles."""
        ends = np.concatenate([self._tool_ends @ T.rotation.T + T.translation for T in places], axis=1)
        gaps = axes.capsule_gaps(ends[0], ends[1], np.tile(self._tool_radii, len(places)))
        return gaps.reshape(len(places), len(self._tool_radii), -1)

    def least(self, q: Array) -> Clearance:
        """Smallest distance of all monitored pairs at q (12)."""
        self._place(q)
        within = self._smallest(self._compute(list(range(len(self._self_pairs)))))
        # An obstacle counts only where it is nearer than the nearest part of the robot itself.
        nearest = self._everything(self._results[within].min_distance)
        pair = self._smallest(nearest)
        return Clearance(float(self._results[pair].min_distance), self._pair(pair))

    def dampers(self, q: Array, influence: float, kinematics: Kinematics | None = None) -> Dampers:
        """How the distance of each pair nearer than `influence` (m) changes with ξ̇.

        Args:
            q: Configuration (12).
            influence: Farther pairs do not count (m).
            kinematics: The robot model's latest, at q; without it they are computed.

        Raises:
            ControlError: The robot model has been at another configuration since `kinematics`.
        """
        robot = self._robot
        if kinematics is None:
            kinematics = robot.kinematics(q)
        elif not same(kinematics.T_odom_tool.translation, self._tool.translation):
            raise ControlError("the robot model was moved after these kinematics; compute them again before dampers")
        pin.updateGeometryPlacements(robot.model, robot.data, self._geometry, self._data)
        if influence != self._known_for or _way(self.motion_bound, q, self._known_at) > _SLACK:
            known = self._nearer(self._everything(influence + _SLACK), influence + _SLACK)
            self._activate(known)
            self._known, self._known_for, self._known_at = known, influence, q.copy()
        else:
            pin.computeDistances(self._geometry, self._data)
        near, results = self._nearer(self._known, influence), self._results
        jacobian, distance = np.empty((len(near), NXI)), np.empty(len(near))
        if not near:
            self.nearest = None
            return Dampers(jacobian, distance, ())
        J, S = robot.data.J, kinematics.S
        for row, p in enumerate(near):
            result = results[p]
            distance[row] = result.min_distance
            _damper(self._normals[p], result.getNearestPoint1(), J, self._moves[p], S, jacobian[row])
        closest = int(distance.argmin())
        self.nearest = Clearance(float(distance[closest]), self._pair(near[closest]))
        return Dampers(jacobian, distance, tuple([self._pair(p) for p in near]))

    def _tool_capsules(self) -> tuple[Array, Array]:
        """Ends of the capsules of the tool's parts in its own frame (2×t×3, m), and their radii (t, m)."""
        q, shapes = np.zeros(NQ), self.shapes
        placed = self.placed(q)[self._tool_rows]
        T_odom_tool = self._robot.pose(q, self._robot.tool_id)
        half = placed[:, 2:9:3] * shapes.half[self._tool_rows, 2:]
        ends = np.stack([placed[:, 9:] - half, placed[:, 9:] + half]) - T_odom_tool.translation
        return ends @ T_odom_tool.rotation, shapes.around[self._tool_rows]

    def _place(self, q: Array) -> None:
        robot = self._robot
        pin.updateGeometryPlacements(robot.model, robot.data, self._geometry, self._data, q)
        # The pairs that dampers knows are no longer the active ones.
        self._known_for = -1.0

    def _everything(self, within: float) -> list[int]:
        """Compute all pairs within the robot, and those with obstacles that may be nearer than `within`."""
        pairs = list(range(len(self._self_pairs)))
        if self._obstacles:
            gaps = self._axes.gaps(np.array(self._centers), self._radii)
            if self._ignores:
                gaps[self._ignored] = np.inf
            parts, obstacles = np.nonzero(gaps < within)
            slots = self._occupy(obstacles.tolist())
            pairs += [self._first(slot) + part for slot, part in zip(slots, parts.tolist(), strict=True)]
        return self._compute(pairs)

    def _compute(self, pairs: list[int]) -> list[int]:
        self._activate(pairs)
        pin.computeDistances(self._geometry, self._data)
        return pairs

    def _nearer(self, pairs: list[int], within: float) -> list[int]:
        return [p for p in pairs if self._results[p].min_distance < within]

    def _smallest(self, pairs: Sequence[int]) -> int:
        return min(pairs, key=lambda p: float(self._results[p].min_distance))

    def _activate(self, pairs: Sequence[int]) -> None:
        wanted = set(pairs)
        for p in self._active - wanted:
            self._data.deactivateCollisionPair(p)
        for p in wanted - self._active:
            self._data.activateCollisionPair(p)
        self._active = wanted

    def _occupy(self, obstacles: list[int]) -> list[int]:
        """Slots of these obstacles; the ones that are new there are put into the geometry."""
        needed = set(obstacles)
        missing = needed - self._slot_of.keys()
        if missing:
            for gone in self._slot_of.keys() - needed:
                self._free.append(self._slot_of.pop(gone))
            if len(missing) > len(self._free):
                self._build(2 * len(needed))
                self._slot_of, self._free, missing = {}, list(range(self._slots)), needed
            for index in missing:
                self._slot_of[index] = self._free.pop()
                self._fill(self._slot_of[index], self._obstacles[index])
            pin.updateGeometryPlacements(self._robot.model, self._robot.data, self._geometry, self._data)
        self._occupants = {slot: index for index, slot in self._slot_of.items()}
        return [self._slot_of[index] for index in obstacles]

    def _fill(self, slot: int, obstacle: Obstacle) -> None:
        start, end = np.array(obstacle.start), np.array(obstacle.end)
        length = float(np.linalg.norm(end - start))
        capsule = self._capsules[slot]
        capsule.radius, capsule.halfLength = obstacle.radius, length / 2
        turn = pin.Quaternion.FromTwoVectors(_Z, (end - start) / length) if length > 1e-9 else pin.Quaternion.Identity()
        T_odom_capsule = pin.SE3(turn.toRotationMatrix(), (start + end) / 2)
        self._geometry.geometryObjects[self._shapes.ngeoms + slot].placement = T_odom_capsule

    def _build(self, slots: int) -> None:
        """Geometry with this many slots, and Pinocchio's data for it."""
        geometry = self._shapes.copy()
        self._capsules = [pin.coal.Capsule(1.0, 1.0) for _ in range(slots)]
        for slot, capsule in enumerate(self._capsules):
            geometry.addGeometryObject(pin.GeometryObject(f"slot{slot}", 0, pin.SE3.Identity(), capsule))
        for a, b in self._self_pairs:
            geometry.addCollisionPair(pin.CollisionPair(a, b))
        parts = range(len(self._parts))
        for slot in range(slots):
            for part in parts:
                geometry.addCollisionPair(pin.CollisionPair(part, self._shapes.ngeoms + slot))
        self._slots, self._geometry, self._data = slots, geometry, geometry.createData()
        self._data.deactivateAllCollisionPairs()
        self._active = set()
        # References and views into Pinocchio's data, which live as long as it does: reading them makes no copies.
        self._results = [self._data.distanceResults[p] for p in range(len(geometry.collisionPairs))]
        self._normals = [result.normal for result in self._results]
        self._centers = [self._data.oMg[part].translation for part in parts]
        within = np.array([self._support[b] - self._support[a] for a, b in self._self_pairs])
        self._moves = np.vstack([within, np.tile(-self._support[:-1], (slots, 1))])
        self._known_for = -1.0

    def _first(self, slot: int) -> int:
        return len(self._self_pairs) + slot * len(self._parts)

    def _pair(self, p: int) -> Pair:
        if p < len(self._self_pairs):
            return self._names[p]
        slot, part = divmod(p - len(self._self_pairs), len(self._parts))
        return self._parts[part], self._obstacles[self._occupants[slot]].name


@compiled(FLAG(VECTOR, VECTOR))
def same(a: Array, b: Array) -> bool:
    """Whether all entries are equal."""
    for i in range(len(a)):
        if a[i] != b[i]:
            return False
    return True


@compiled(NUMBER(VECTOR, VECTOR, VECTOR))
def _way(weights: Array, q: Array, q_before: Array) -> float:
    """Weights · |q − q_before|; see `_motion_bound`."""
    way = 0.0
    for i in range(len(q)):
        way += weights[i] * abs(q[i] - q_before[i])
    return way


@compiled(NOTHING(VECTOR, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR))
def _damper(n: Array, at: Array, J: Array, moves: Array, S: Array, jacobian: Array) -> None:
    """Write the row (9) of ḋ = n·(v_b − v_a) over ξ̇: the wrench of a unit force along n at the nearest points.

    Args:
        n: From the first side to the second (3, odom).
        at: Nearest point of the first side (3, m, odom); with any other on the line along n the wrench is the same.
        J: Of every joint's axis, at odom's origin (6×12).
        moves: 1 for each coordinate of q that moves the second side, −1 the first, 0 both alike or neither (12).
        S: S(q) (12×9).
        jacobian: Written.
    """
    moment = (at[1] * n[2] - at[2] * n[1], at[2] * n[0] - at[0] * n[2], at[0] * n[1] - at[1] * n[0])
    jacobian[:] = 0.0
    for i in range(12):
        if moves[i] != 0.0:
            along = n[0] * J[0, i] + n[1] * J[1, i] + n[2] * J[2, i]
            along += moment[0] * J[3, i] + moment[1] * J[4, i] + moment[2] * J[5, i]
            for j in range(9):
                jacobian[j] += moves[i] * along * S[i, j]


def _support(model: Any, joint: int) -> Array:
    """1 for each coordinate of q that moves the bodies on a joint, else 0 (12)."""
    out = np.zeros(NQ)
    for ancestor in model.supports[joint]:
        if ancestor:
            out[model.idx_vs[ancestor]] = 1.0
    return out


def _motion_bound(model: Any, shapes: Any, radii: Array) -> Array:
    """Weights (12): no point of the robot moves farther, relative to any other, than weights · |Δq| (m)."""
    out = np.zeros(NQ)
    for item, radius in zip(shapes.geometryObjects, radii, strict=True):
        reach = float(np.linalg.norm(item.placement.translation)) + float(radius)
        for joint in reversed([j for j in model.supports[item.parentJoint] if j]):
            translates = model.joints[joint].shortname() in _TRANSLATING
            at = model.idx_vs[joint]
            out[at] = max(out[at], 1.0 if translates else reach)
            reach += float(np.linalg.norm(model.jointPlacements[joint].translation))
    return out
