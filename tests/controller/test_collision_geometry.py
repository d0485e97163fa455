import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from controller.whole_body.collision_geometry import BASE, CASTER, TOOL, bounding_radius, part_of, robot_geometry
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.resources import panda_description, resource

ROBOT = RobotModel()
SHAPES = robot_geometry(ROBOT)


def outside(points, parts, q):
    """How far each point of odom (n×3) is outside the nearest capsule of `parts` at q (m); negative inside."""
    data = SHAPES.createData()
    pin.updateGeometryPlacements(ROBOT.model, ROBOT.data, SHAPES, data, q)
    best = np.full(len(points), np.inf)
    for item, T in zip(SHAPES.geometryObjects, data.oMg, strict=True):
        if part_of(item.name) in parts and isinstance(item.geometry, pin.coal.Capsule):
            capsule = item.geometry
            offset = points - T.translation
            t = np.clip(offset @ T.rotation[:, 2], -capsule.halfLength, capsule.halfLength)
            gap = np.linalg.norm(offset - t[:, None] * T.rotation[:, 2], axis=1) - capsule.radius
            best = np.minimum(best, gap)
    return best


def placed(frame, points, q):
    T = ROBOT.pose(q, ROBOT.frame_id(frame))
    return points @ T.rotation.T + T.translation


@pytest.mark.parametrize("seed", range(5))
def test_capsules_enclose_the_meshes_of_the_arm_in_any_posture(seed):
    rng = np.random.default_rng(seed)
    q = np.zeros(12)
    q[ARM_Q] = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    links = [f"link{i}" for i in range(8)]
    for link in links:
        mesh = trimesh.load(str(panda_description() / "meshes" / "collision" / f"{link}.stl"))
        gap = outside(placed(f"panda_{link}", np.asarray(mesh.vertices), q), links, q)
        # The foot, which stands on the deck and does not move, has corners that stick out by 11 mm.
        most = 0.012 if link == "link0" else 0.0
        assert gap.max() < most, f"{link} sticks out by {gap.max() * 1e3:.0f} mm"


def test_capsules_enclose_the_tool_as_it_is_drawn():
    q = np.zeros(12)
    root = ET.fromstring(resource("assets/urdf/tool.urdf").read_text())
    corners = 2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1
    drawn = 0
    for link in root.iter("link"):
        for visual in link.iter("visual"):
            origin = visual.find("origin")
            given = {} if origin is None else origin.attrib
            xyz, rpy = (np.array([float(v) for v in given.get(key, "0 0 0").split()]) for key in ("xyz", "rpy"))
            box, cylinder = visual.find("geometry/box"), visual.find("geometry/cylinder")
            if box is not None:
                points = corners * [float(v) / 2 for v in box.get("size").split()]
            else:
                turn = np.linspace(0, 2 * np.pi, 25)
                rim = float(cylinder.get("radius")) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
                half = float(cylinder.get("length")) / 2
                points = np.vstack([np.column_stack([rim, np.full(25, z)]) for z in (-half, half)])
            points = points @ pin.rpy.rpyToMatrix(rpy).T + xyz
            # The bracket lies within the last link's capsule.
            assert outside(placed(link.get("name"), points, q), (*TOOL, "link7"), q).max() < 0.5e-3
            drawn += 1
    assert drawn == 5


def test_base_is_a_box_around_body_and_wheels_from_the_floor_to_the_deck():
    base = next(item for item in SHAPES.geometryObjects if part_of(item.name) == BASE)
    low = base.placement.translation - base.geometry.halfSide
    high = base.placement.translation + base.geometry.halfSide
    # Body x −0.523…0.190, deck at 0.358; the wheels' outer faces at 0.2535 + 0.085/2 (vendor).
    np.testing.assert_allclose(low, [-0.523, -0.296, 0.0], atol=1e-6)
    np.testing.assert_allclose(high, [0.190, 0.296, 0.358], atol=1e-6)


def test_casters_wheel_is_inside_its_sphere_in_every_direction():
    sphere = next(item for item in SHAPES.geometryObjects if part_of(item.name) == CASTER)
    turn = np.linspace(0, 2 * np.pi, 73)
    # Pivot (−0.43, 0), trail 0.060, radius 0.080, width 0.035 m.
    for direction in turn:
        c, s = np.cos(direction), np.sin(direction)
        for side in (-0.0175, 0.0175):
            along = -0.060 + 0.080 * np.cos(turn)
            rim = np.stack([-0.43 + c * along - s * side, s * along + c * side, 0.080 + 0.080 * np.sin(turn)], axis=1)
            assert np.linalg.norm(rim - sphere.placement.translation, axis=1).max() <= sphere.geometry.radius


def test_bounding_radius_is_that_of_the_farthest_point():
    assert bounding_radius(pin.coal.Capsule(0.1, 1.0)) == pytest.approx(0.6)
    assert bounding_radius(pin.coal.Sphere(0.3)) == pytest.approx(0.3)
    assert bounding_radius(pin.coal.Box(2.0, 4.0, 4.0)) == pytest.approx(3.0)
