"""Collision geometry of the robot: capsules, one sphere and one box in Coal, on Pinocchio's joints.

- Arm: the cylinders with spherical ends of `panda_collision.urdf` (example-robot-data, after franka_description), taken
  as capsules: radii 0.045 to 0.09 m. In any posture the meshes of the moving links are inside them, by 6 to 32 mm.
- Tool: capsules around the shapes of `assets/urdf/tool.urdf`.
- Base: the smallest box around body and wheels of `assets/urdf/base.urdf`, from the floor up, and a sphere around
  every position of the caster's wheel.
"""

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rolling_panda.model.differential_drive import NQ, Array
from rolling_panda.model.robot import ARM_Q, RobotModel, panda_urdf
from rolling_panda.resources import panda_description, resource

BASE, CASTER, GROUND, BLADES, CUTTER, CAMERA = "base", "caster", "ground", "blades", "cutter", "camera"
#: The parts that the cutter brings to the vine.
TOOL = (CUTTER, BLADES, CAMERA)
_SEPARATOR = "#"
#: Tool's capsules: part, link, centre (m), turn of the axis z about x and y (rad), radius and length of the axis (m).
#: The camera's housing is 90 × 25 × 25 mm (data sheet), the handle 24 mm in radius, a blade 12 × 5 × 70 mm.
_TOOL_CAPSULES = (
    (CUTTER, "cutter_link", (0.0, 0.0, 0.061), (0.0, 0.0), 0.033, 0.102),
    (BLADES, "cutter_link", (0.019, 0.0, 0.160), (0.0, 0.12), 0.0066, 0.070),
    (BLADES, "cutter_link", (-0.019, 0.0, 0.160), (0.0, -0.12), 0.0066, 0.070),
    (CAMERA, "camera_body_link", (0.0, 0.0, 0.0), (0.0, np.pi / 2), 0.020, 0.072),
)
#: The caster's wheel (radius 0.080, width 0.035, trail 0.060 m, vendor's mesh) in every direction it can turn to: its
#: farthest point is (0.140, 0.0175, −0.02) m from the sphere's middle.
_CASTER_RADIUS, _CASTER_HEIGHT = 0.145, 0.100


@dataclass(frozen=True)
class Shapes:
    """The robot's parts as rounded boxes: a box, which may be a line or a point, with a radius around it.

    Attributes:
        parts: Names (p); a part of several shapes appears once for each.
        half: Half sizes of the boxes (p×3, m).
        around: Radius of the rounding (p, m), that of a capsule or a sphere.
    """

    parts: tuple[str, ...]
    half: Array
    around: Array


def robot_geometry(robot: RobotModel) -> Any:
    """Pinocchio's geometry model of arm, tool and base, without pairs; `part_of` reads the parts' names."""
    geometry = pin.GeometryModel()
    _add_base(geometry, robot)
    _add_arm(geometry, robot)
    for part, link, center, (roll, pitch), radius, length in _TOOL_CAPSULES:
        T = pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, 0.0), np.array(center))
        _add(geometry, robot, part, link, pin.coal.Capsule(radius, length), T)
    return geometry


def add_ground(geometry: Any) -> int:
    """Add the half-space below z = 0 of odom; returns its index."""
    ground = pin.GeometryObject(GROUND, 0, pin.SE3.Identity(), pin.coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))
    return int(geometry.addGeometryObject(ground))


def part_of(name: str) -> str:
    """The part that a geometry object belongs to: `base`, `link5`, `camera`, …."""
    return name.split(_SEPARATOR)[0]


def bounding_radius(shape: Any) -> float:
    """Radius (m) of the sphere about the origin of a capsule, sphere or box that encloses it."""
    if isinstance(shape, pin.coal.Capsule):
        return float(shape.halfLength + shape.radius)
    if isinstance(shape, pin.coal.Sphere):
        return float(shape.radius)
    return float(np.linalg.norm(shape.halfSide))


def shapes_of(objects: Sequence[Any]) -> Shapes:
    """Of capsules, spheres and boxes."""
    cores = [_core(item.geometry) for item in objects]
    half, around = np.array([half for half, _ in cores]), np.array([around for _, around in cores])
    return Shapes(tuple(part_of(item.name) for item in objects), half, around)


def _core(shape: Any) -> tuple[tuple[float, float, float], float]:
    """Half sizes of the inner box of a capsule, sphere or box (m), and the radius around it (m)."""
    if isinstance(shape, pin.coal.Capsule):
        return (0.0, 0.0, float(shape.halfLength)), float(shape.radius)
    if isinstance(shape, pin.coal.Sphere):
        return (0.0, 0.0, 0.0), float(shape.radius)
    x, y, z = shape.halfSide.tolist()
    return (x, y, z), 0.0


def _add(geometry: Any, robot: RobotModel, part: str, frame: str, shape: Any, T_frame_shape: Any) -> None:
    at = robot.model.frames[robot.frame_id(frame)]
    name = f"{part}{_SEPARATOR}{geometry.ngeoms}"
    geometry.addGeometryObject(pin.GeometryObject(name, at.parentJoint, at.placement * T_frame_shape, shape))


def _add_arm(geometry: Any, robot: RobotModel) -> None:
    text = panda_urdf("panda_collision.urdf")
    arm = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(arm, text, pin.GeometryType.COLLISION)
    for item in shapes.geometryObjects:
        # The spheres are the ends of the capsules.
        if isinstance(item.geometry, pin.coal.Cylinder):
            frame = arm.frames[item.parentFrame]
            cylinder = item.geometry
            capsule = pin.coal.Capsule(cylinder.radius, 2 * cylinder.halfLength)
            part = frame.name.removeprefix("panda_")
            _add(geometry, robot, part, frame.name, capsule, frame.placement.actInv(item.placement))


def _add_base(geometry: Any, robot: RobotModel) -> None:
    text = resource("assets/urdf/base.urdf").read_text()
    base = pin.buildModelFromXML(text)
    data = base.createData()
    shapes = pin.buildGeomFromUrdfString(base, text, pin.GeometryType.COLLISION)
    placed = shapes.createData()
    pin.updateGeometryPlacements(base, data, shapes, placed, pin.neutral(base))
    signs = 2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1
    corners: list[Any] = []
    for item, T in zip(shapes.geometryObjects, placed.oMg, strict=True):
        item.geometry.computeLocalAABB()
        corners += [T.act(item.geometry.aabb_local.max_ * sign) for sign in signs]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    low[2] = 0.0
    box = pin.SE3(np.eye(3), (low + high) / 2)
    _add(geometry, robot, BASE, "base_link", pin.coal.Box(*(high - low)), box)
    caster = pin.SE3.Identity()
    caster.translation[:2] = robot.model.frames[robot.frame_id("caster_pivot_link")].placement.translation[:2]
    caster.translation[2] = _CASTER_HEIGHT
    _add(geometry, robot, CASTER, "base_link", pin.coal.Sphere(_CASTER_RADIUS), caster)


#: Postures that decide which pairs can come near each other at all, and what "near" means (m).
_SAMPLES, _SEED, _NEVER_NEARER = 4096, 20240521, 0.05
#: A pair whose distance varies by less than this (m) counts as rigid.
_CONSTANT = 1e-6
_CARRIED = (BASE, CASTER, "link0")
_NEIGHBOURS_OF_TOOL = ("link6", "link7")
#: Cache of the pairs by their inputs, because a process has several models of one robot.
_decided: dict[tuple[object, ...], tuple[tuple[int, int], ...]] = {}


def self_pairs(robot: RobotModel, geometry: Any, ground: int) -> list[tuple[int, int]]:
    """Pairs of indices into `geometry` to monitor: within the robot, and arm and tool against the ground.

    Left out are the pairs that the SRDF disables, those whose distance no motion changes, and those that stay farther
    apart than 50 mm in 4096 seeded random postures within the joint limits.

    Cutter and camera are longer than the hand of the SRDF, so that of the entries of the hand only those with its
    neighbours, links 6 and 7, apply.

    Args:
        robot: Robot model with the joints of the geometry.
        geometry: Pinocchio's geometry model with the ground.
        ground: Index of the ground.
    """
    bounds = robot.limits.lower[ARM_Q].tobytes(), robot.limits.upper[ARM_Q].tobytes()
    known = (robot.model.saveToString(), geometry.saveToString(), *bounds, ground)
    if known not in _decided:
        _decided[known] = tuple(_decide(robot, geometry, ground))
    return list(_decided[known])


def _decide(robot: RobotModel, geometry: Any, ground: int) -> list[tuple[int, int]]:
    disabled = _disabled_links()
    parts = [part_of(item.name) for item in geometry.geometryObjects]
    joints = [item.parentJoint for item in geometry.geometryObjects]
    pairs = []
    for a, b in itertools.combinations(range(len(parts)), 2):
        moves = joints[a] != joints[b]
        if ground in (a, b):
            moves = parts[a if b == ground else b] not in (*_CARRIED, GROUND)
        if moves and not _is_disabled(parts[a], parts[b], disabled):
            pairs.append((a, b))
    distances = _sampled(robot, geometry, pairs)
    least, most = distances.min(axis=0), distances.max(axis=0)
    keep = (least < _NEVER_NEARER) & (most - least > _CONSTANT)
    return [pair for pair, kept in zip(pairs, keep, strict=True) if kept]


def _is_disabled(a: str, b: str, disabled: frozenset[frozenset[str]]) -> bool:
    if a in TOOL or b in TOOL:
        return bool({a, b} & set(_NEIGHBOURS_OF_TOOL))
    return frozenset((a, b)) in disabled


def _disabled_links() -> frozenset[frozenset[str]]:
    root = ET.parse(panda_description() / "srdf" / "panda.srdf").getroot()
    return frozenset(
        frozenset(entry.get(key, "").removeprefix("panda_") for key in ("link1", "link2"))
        for entry in root.iter("disable_collisions")
    )


def _sampled(robot: RobotModel, geometry: Any, pairs: list[tuple[int, int]]) -> Array:
    """Distances (samples × pairs, m) in seeded random postures of the arm."""
    trial = geometry.copy()
    trial.removeAllCollisionPairs()
    for a, b in pairs:
        trial.addCollisionPair(pin.CollisionPair(a, b))
    data = trial.createData()
    results = [data.distanceResults[i] for i in range(len(pairs))]
    rng = np.random.default_rng(_SEED)
    lower, upper = robot.limits.lower[ARM_Q], robot.limits.upper[ARM_Q]
    q, out = np.zeros(NQ), np.empty((_SAMPLES, len(pairs)))
    for row in out:
        q[ARM_Q] = rng.uniform(lower, upper)
        pin.computeDistances(robot.model, robot.data, trial, data, q)
        row[:] = [result.min_distance for result in results]
    return out
