"""MuJoCo model of the robot and the solid parts of the row, from the same parameters as the Pinocchio model.

Physics assumptions:
- Hard floor. Each driven wheel has one contact point below its centre (a sphere of the rolling radius), so that the
  track is exact and turning does not scrub. Uneven ground is a plane under each wheel, which follows the ground there
  and gives way a little.
- The caster's fork and wheel are bodies of their own.
- The base has a free joint; only friction holds it.
- Posts, trunks, cordons and wires are rigid, and so is last year's cane of a Guyot vine until it is severed. Canes and
  spurs are visible and can be cut, but do not collide.
- Arm, tool and base collide with each other, the floor and the row, except for the pairs that the Panda's description
  excludes.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from bridge.sim.robot.inertial import ACCELEROMETER
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.errors import Errors
from rolling_panda.errors import ModelError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import assemble, panda_urdf
from rolling_panda.resources import panda_description, resource

STEP_S = 0.001
WHEELS = ("wheel_left", "wheel_right")
ARM = tuple(f"panda_joint{i}" for i in range(1, 8))
_TYRES = ("wheel_left_tyre", "wheel_right_tyre", "caster_wheel_tyre")
SOLID = frozenset({"post", "trunk", "cordon", "wire", "hose"})
_ROLLS, _HITS_ROW, _HITS_BASE, _HITS_ARM = 1, 2, 4, 8
# First of the bits of the planes under the wheels.
_OWN_GROUND = 16
# Estimates; the masses of the caster are not published.
_FORK_MASS, _CASTER_MASS = 0.6, 0.8
_CASTER_RADIUS, _CASTER_TRAIL = 0.080, 0.060
# Inertia of a wheel's motor reflected through its gear (kg·m²): estimate, 1e-4 at about 1:30.
_WHEEL_ROTOR = 0.1
# Stiff: a loaded wheel penetrates the floor by less than 1 µm.
_FLOOR_SOLREF = (0.002, 1.0)
_FLOOR_SOLIMP = (0.99, 0.999, 0.0001, 0.5, 2.0)
# Tyre and soil of uneven ground together give way by 0.04 to 0.2 mm. A plane differs by up to 1 µm from the next, 1 mm
# farther: a wheel on stiff ground would lose it for a step, and strike it in the next.
_SOIL_SOLREF = (0.01, 1.0)
_SOIL_SOLIMP = (0.95, 0.95, 0.001, 0.5, 2.0)
_RUBBER, _GRAVITY = 0.9, 9.81


@dataclass(frozen=True)
class Plant:
    """A compiled model and its indices.

    Attributes:
        model: MjModel.
        xi_q: Indices of ξ in qpos (9).
        xi_v: Indices of ξ in qvel (9).
        xi_block: Open mesh of xi_v, which picks the rows and columns of ξ from a mass matrix.
        wheel_load: Inertia of the robot felt by a driven wheel (kg·m²).
        arm_v: Indices of the arm's joints in qvel (7).
        tool: Site of the tool frame.
        camera: Site of the camera's optical frame.
        solid: Whether a geom is a post, trunk, cordon or wire (ngeom).
        rolling: Whether a geom is a tyre or the floor (ngeom).
        ground: Planes under the wheels on uneven ground, each with the body of its wheel; empty on a flat floor.
        severable: Geoms of last year's canes, each with the index of its rod.
    """

    model: Any
    xi_q: Any
    xi_v: Any
    xi_block: Any
    wheel_load: float
    arm_v: Any
    tool: int
    camera: int
    solid: Any
    rolling: Any
    ground: tuple[tuple[int, int], ...] = ()
    severable: tuple[tuple[int, int], ...] = ()

    def remove_severed(self, row: Row) -> None:
        """Let the robot meet no more of last year's canes than stands in a row that was cut.

        What hangs in the wires gives way like other severed wood.
        """
        model = self.model
        for geom, index in self.severable:
            rod = row.rods[index]
            if rod is None or rod.hanging:
                model.geom_conaffinity[geom] = 0
                continue
            half = float(np.linalg.norm(rod.end - rod.start)) / 2
            model.geom_pos[geom], model.geom_size[geom, 1] = (rod.start + rod.end) / 2, half
            model.geom_rbound[geom] = half + model.geom_size[geom, 0]


def build_plant(row: Row, errors: Errors | None = None, uneven: bool = False, inertial: bool = False) -> Plant:
    """Compile the robot at odom's origin beside the solid rods of `row`.

    Args:
        row: The row.
        errors: How this robot differs from the program's model of it; None for not at all.
        uneven: The ground has a plane of its own under each wheel, which `Plant.ground` names.
        inertial: The camera has a gyroscope and an accelerometer.

    Raises:
        ModelError: MuJoCo refuses the model.
    """
    robot = assemble()
    factors = np.ones(2)
    if errors is not None:
        _misplace(robot, errors)
        factors = errors.wheels
    spec = mujoco.MjSpec()
    _options(spec, uneven)
    if errors is not None and errors.slope[0] != 0.0:
        spec.option.gravity = (-_GRAVITY * np.sin(errors.slope[0]), 0.0, -_GRAVITY * np.cos(errors.slope[0]))
    _add_row(spec, row)
    bodies = {robot.getJointId("base_phi"): _add_base(spec, robot)}
    for name in (*WHEELS, *ARM):
        joint_id = robot.getJointId(name)
        bodies[joint_id] = _add_link(bodies[robot.parents[joint_id]], robot, joint_id)
    base = bodies[robot.getJointId("base_phi")]
    for name, factor in zip(WHEELS, factors, strict=True):
        height = robot.jointPlacements[robot.getJointId(name)].translation[2]
        _add_wheel_contact(bodies[robot.getJointId(name)], height * factor)
    _add_caster(base, _in_joint(robot, "caster_pivot_link"))
    if uneven:
        _add_ground(spec)
    for name in (*WHEELS, *ARM):
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
    _add_collisions(bodies, robot)
    _exclude_neighbours(spec)
    for frame in ("tool", "camera"):
        _add_site(bodies, robot, frame)
    if inertial:
        kind, site = mujoco.mjtSensor.mjSENS_ACCELEROMETER, mujoco.mjtObj.mjOBJ_SITE
        spec.add_sensor(name=ACCELEROMETER, type=kind, objtype=site, objname="camera")
    try:
        model = spec.compile()
    except ValueError as error:
        raise ModelError(f"MuJoCo refuses the robot: {error}") from error
    return _plant(model, row)


def _misplace(robot: Any, errors: Errors) -> None:
    """Move arm and wheels of the assembled model (pinocchio) to where they really are."""
    shoulder, foot = robot.getJointId(ARM[0]), _in_joint(robot, "panda_link0")
    if not errors.mount.isIdentity():
        robot.jointPlacements[shoulder] = foot * errors.mount * foot.inverse() * robot.jointPlacements[shoulder]
    for name in WHEELS:
        placed = robot.jointPlacements[robot.getJointId(name)]
        at = placed.translation * [1.0, errors.track, 1.0]
        robot.jointPlacements[robot.getJointId(name)] = pin.SE3(placed.rotation, at)


def _add_ground(spec: Any) -> None:
    """A plane for each tyre, that no other one touches."""
    for number, tyre in enumerate(_TYRES):
        own = _OWN_GROUND << number
        spec.geom(tyre).contype = own
        plane = spec.worldbody.add_geom(name=f"under_{tyre}", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
        plane.contype, plane.conaffinity = 0, own
        # Neither at the origin nor level: such a plane would not be moved.
        plane.pos, plane.quat = [0.0, 0.0, -1e-3], [1.0, 1e-3, 0.0, 0.0]
        _rubber(plane, _RUBBER)
        plane.solref, plane.solimp, plane.priority = list(_SOIL_SOLREF), list(_SOIL_SOLIMP), 1


def _plant(model: Any, row: Row) -> Plant:
    def joint(name: str) -> int:
        return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name))

    xi_v = np.array([model.jnt_dofadr[joint(name)] for name in (*WHEELS, *ARM)])
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, i) or "" for i in range(model.ngeom)]
    return Plant(
        model,
        np.array([model.jnt_qposadr[joint(name)] for name in (*WHEELS, *ARM)]),
        xi_v,
        np.ix_(xi_v, xi_v),
        0.5 * float(model.body_mass.sum()) * float(model.geom("wheel_left_tyre").size[0]) ** 2 + _WHEEL_ROTOR,
        xi_v[2:],
        int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "tool")),
        int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "camera")),
        np.array([name.startswith("row_") for name in names]),
        np.array([name == "floor" or name.endswith("_tyre") for name in names]),
        tuple(
            (names.index(f"under_{tyre}"), int(model.geom_bodyid[names.index(tyre)]))
            for tyre in _TYRES
            if f"under_{tyre}" in names
        ),
        tuple((names.index(_geom_name(index, rod)), index) for index, rod in row.standing() if rod.last_years),
    )


def _options(spec: Any, uneven: bool) -> None:
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # Friction much stiffer than the normal direction: otherwise the wheels creep under the servo torque.
    spec.option.impratio = 100.0
    spec.option.iterations = 30
    spec.option.gravity = (0.0, 0.0, -_GRAVITY)
    floor = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    floor.contype, floor.conaffinity = 0, _HITS_BASE if uneven else _ROLLS | _HITS_BASE
    _rubber(floor, _RUBBER)


def _rubber(geom: Any, friction: float) -> None:
    geom.friction = [friction, 0.0, 0.0]
    geom.condim = 3
    geom.solref = list(_FLOOR_SOLREF)
    geom.solimp = list(_FLOOR_SOLIMP)


def _add_row(spec: Any, row: Row) -> None:
    for index, rod in row.standing():
        if rod.kind not in SOLID:
            continue
        geom = spec.worldbody.add_geom(
            name=_geom_name(index, rod),
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*rod.start, *rod.end],
            size=[max(rod.start_radius, rod.end_radius), 0.0, 0.0],
        )
        geom.contype, geom.conaffinity = 0, _HITS_ROW


def _geom_name(index: int, rod: Rod) -> str:
    return f"row_{rod.kind}_{index}"


def _add_base(spec: Any, robot: Any) -> Any:
    body = spec.worldbody.add_body(name="base_link")
    body.add_freejoint(name="base")
    _set_inertia(body, robot.inertias[robot.getJointId("base_phi")])
    return body


def _add_link(parent: Any, robot: Any, joint_id: int) -> Any:
    placement = robot.jointPlacements[joint_id]
    name = robot.names[joint_id]
    body = parent.add_body(name=name, pos=placement.translation, quat=_quat_wxyz(placement.rotation))
    axis = {"JointModelRY": [0, 1, 0], "JointModelRZ": [0, 0, 1]}.get(robot.joints[joint_id].shortname())
    if axis is None:
        raise ModelError(f"{name} is a {robot.joints[joint_id].shortname()}; the simulation knows turning y and z axes")
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
    joint.armature = _WHEEL_ROTOR if name in WHEELS else 0.0
    _set_inertia(body, robot.inertias[joint_id])
    return body


def _set_inertia(body: Any, inertia: Any) -> None:
    I = inertia.inertia  # noqa: E741 - the field's name
    body.mass = inertia.mass
    body.ipos = inertia.lever
    body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    body.explicitinertial = True


def _add_wheel_contact(body: Any, radius: float) -> None:
    tyre = body.add_geom(name=f"{body.name}_tyre", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0])
    tyre.contype, tyre.conaffinity = _ROLLS, 0
    _rubber(tyre, _RUBBER)


def _add_caster(base: Any, T_base_pivot: Any) -> None:
    fork = base.add_body(name="caster_fork", pos=T_base_pivot.translation)
    fork.add_joint(name="caster_swivel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], damping=0.01)
    fork.mass, fork.ipos, fork.inertia = _FORK_MASS, [-_CASTER_TRAIL / 2, 0, -0.04], [0.001, 0.001, 0.001]
    fork.explicitinertial = True
    drop = T_base_pivot.translation[2] - _CASTER_RADIUS
    wheel = fork.add_body(name="caster_wheel", pos=[-_CASTER_TRAIL, 0, -drop])
    wheel.add_joint(name="caster_roll", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], damping=0.001)
    half, disc = _CASTER_MASS * _CASTER_RADIUS**2 / 4, _CASTER_MASS * _CASTER_RADIUS**2 / 2
    wheel.mass, wheel.ipos, wheel.inertia = _CASTER_MASS, [0, 0, 0], [half, disc, half]
    wheel.explicitinertial = True
    _add_wheel_contact(wheel, _CASTER_RADIUS)


def _add_collisions(bodies: dict[int, Any], robot: Any) -> None:
    for text, meets in (
        (resource("assets/urdf/base.urdf").read_text(), {"base_link"}),
        (panda_urdf("panda_collision.urdf"), {f"panda_link{i}" for i in range(1, 8)}),
        (resource("assets/urdf/tool.urdf").read_text(), {"cutter_link", "camera_body_link"}),
    ):
        for link in ET.fromstring(text).iter("link"):
            name = link.get("name", "")
            if name not in meets:
                continue
            for collision in link.findall("collision"):
                _add_collision(bodies, robot, name, collision)


def _add_collision(bodies: dict[int, Any], robot: Any, link: str, collision: Any) -> None:
    """One URDF shape; a cylinder of the Panda, whose ends carry spheres of its radius, becomes a capsule."""
    origin = collision.find("origin")
    attributes = {} if origin is None else origin.attrib
    xyz = np.array([float(v) for v in attributes.get("xyz", "0 0 0").split()])
    rpy = np.array([float(v) for v in attributes.get("rpy", "0 0 0").split()])
    shape = collision.find("geometry")[0]
    if shape.tag == "sphere":
        return
    panda = link.startswith("panda")
    if shape.tag == "cylinder":
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE if panda else mujoco.mjtGeom.mjGEOM_CYLINDER
        size = [float(shape.get("radius")), float(shape.get("length")) / 2, 0.0]
    elif shape.tag == "box":
        kind, size = mujoco.mjtGeom.mjGEOM_BOX, [float(v) / 2 for v in shape.get("size").split()]
    else:
        raise ModelError(f"{link} has a collision {shape.tag}; the simulation knows box, cylinder and sphere")
    T = _in_joint(robot, link) * pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
    body = bodies[robot.frames[robot.getFrameId(link)].parentJoint]
    geom = body.add_geom(type=kind, size=size, pos=T.translation, quat=_quat_wxyz(T.rotation))
    near_base = link in ("base_link", "panda_link1", "panda_link2")
    # Link 7 has the body of cutter and camera, and is next to link 5 in every posture.
    meets_arm = link not in ("base_link", "panda_link7")
    geom.contype = _HITS_ROW | (0 if near_base else _HITS_BASE) | (_HITS_ARM if meets_arm else 0)
    geom.conaffinity = _HITS_BASE if link == "base_link" else _HITS_ARM if meets_arm else 0


def _exclude_neighbours(spec: Any) -> None:
    """Exclude the pairs of arm links that the Panda's SRDF excludes.

    Cutter and camera replace the hand in the body of joint 7 and may touch link 5, so that this pair is kept.
    """
    text = (panda_description() / "srdf" / "panda.srdf").read_text()
    joint_of = {f"panda_link{i}": f"panda_joint{i}" for i in range(1, 8)}
    for pair in ET.fromstring(text).iter("disable_collisions"):
        one, other = joint_of.get(pair.get("link1", "")), joint_of.get(pair.get("link2", ""))
        if one is not None and other is not None and (one, other) != ("panda_joint5", "panda_joint7"):
            spec.add_exclude(bodyname1=one, bodyname2=other)


def _add_site(bodies: dict[int, Any], robot: Any, frame: str) -> None:
    T = _in_joint(robot, frame)
    body = bodies[robot.frames[robot.getFrameId(frame)].parentJoint]
    body.add_site(name=frame, pos=T.translation, quat=_quat_wxyz(T.rotation))


def _in_joint(robot: Any, frame: str) -> Any:
    """Placement of a frame in the body of the joint that carries it."""
    return robot.frames[robot.getFrameId(frame)].placement


def _quat_wxyz(R: Array) -> list[float]:
    x, y, z, w = pin.Quaternion(R).coeffs()
    return [float(w), float(x), float(y), float(z)]
