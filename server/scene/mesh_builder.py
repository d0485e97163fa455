"""Builds the scene's meshes: of the robot from the visuals of our URDFs and of the Panda's, and a ball.

The server does not import this module, which brings a mesh library: `solids.py` runs it in a process of its own.
"""

import pickle
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh
from numpy.typing import NDArray

from rolling_panda.errors import ModelError
from rolling_panda.model.robot import RobotModel, panda_urdf
from rolling_panda.resources import resource
from server.scene.meshes import Color
from server.scene.solids import Part, Solid, Solids

Array = NDArray[np.float64]

#: The Panda's meshes have about 125,000 faces, most of them in fillets. Every view draws them all in every frame, so a
#: mesh keeps about as many as its surface needs to look round (faces a m²), and a small one not too few for its shape.
_DENSITY = 14_000
_FEWEST_FACES = 48
#: Edges sharper than this (rad) stay sharp when shaded.
_CREASE = 0.6


def robot_parts(model: Any) -> list[Part]:
    """Every visible part of the assembled robot; `model` is `RobotModel.model`.

    Raises:
        ModelError: A mesh is missing or unreadable.
    """
    documents = (
        resource("assets/urdf/base.urdf").read_text(),
        panda_urdf(),
        resource("assets/urdf/tool.urdf").read_text(),
    )
    groups: dict[tuple[int, Color], list[trimesh.Trimesh]] = {}
    for document in documents:
        for link in ET.fromstring(document).iter("link"):
            name = link.get("name", "")
            if not model.existFrame(name):
                continue
            frame = model.frames[model.getFrameId(name)]
            for visual in link.findall("visual"):
                T_joint_visual = frame.placement.homogeneous @ _origin(visual)
                for mesh, color in _shapes(visual):
                    mesh.apply_transform(T_joint_visual)
                    groups.setdefault((frame.parentJoint, color), []).append(mesh)
    return [_part(joint, color, meshes) for (joint, color), meshes in groups.items()]


def _part(joint: int, color: Color, meshes: list[trimesh.Trimesh]) -> Part:
    merged = trimesh.util.concatenate(meshes)
    smooth = trimesh.graph.smooth_shade(merged, angle=_CREASE)
    return Part(joint, color, np.asarray(smooth.vertices, np.float32), np.asarray(smooth.faces, np.uint32))


def _shapes(visual: ET.Element) -> list[tuple[trimesh.Trimesh, Color]]:
    geometry = visual.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        return []
    if shape.tag == "mesh":
        return _mesh(Path(shape.get("filename", "")))
    color = _color(visual)
    if shape.tag == "box":
        return [(trimesh.creation.box(extents=_numbers(shape.get("size", ""))), color)]
    if shape.tag == "cylinder":
        radius, length = float(shape.get("radius", "0")), float(shape.get("length", "0"))
        return [(trimesh.creation.cylinder(radius=radius, height=length, sections=40), color)]
    raise ModelError(f"a visual has the geometry <{shape.tag}>; known are box, cylinder and mesh")


def _mesh(path: Path) -> list[tuple[trimesh.Trimesh, Color]]:
    try:
        scene = trimesh.load_scene(path)
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot read the mesh {path}: {error}") from error
    out = []
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[name]
        source = scene.geometry[geometry]
        red, green, blue, _ = (int(value) for value in source.visual.material.main_color)
        mesh = simplified(np.asarray(source.vertices, float), np.asarray(source.faces))
        mesh.apply_transform(transform)
        out.append((mesh, (red, green, blue)))
    return out


def simplified(vertices: Array, faces: NDArray[Any]) -> trimesh.Trimesh:
    """The same surface in fewer faces, by quadric edge collapse (Garland and Heckbert 1997).

    Args:
        vertices: (V, 3), m.
        faces: (F, 3), indices of vertices.
    """
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    # Exporters split the vertices at every sharp edge, and split vertices cannot be merged by the simplification.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    wanted = max(_FEWEST_FACES, round(_DENSITY * mesh.area))
    if len(mesh.faces) <= wanted:
        return mesh
    return mesh.simplify_quadric_decimation(face_count=wanted)


def _origin(visual: ET.Element) -> Array:
    origin = visual.find("origin")
    if origin is None:
        return np.eye(4)
    xyz, rpy = _numbers(origin.get("xyz", "0 0 0")), _numbers(origin.get("rpy", "0 0 0"))
    placement: Array = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz).homogeneous
    return placement


def _color(visual: ET.Element) -> Color:
    color = visual.find("material/color")
    red, green, blue, _ = _numbers("0.7 0.7 0.7 1" if color is None else color.get("rgba", ""))
    return (round(255 * red), round(255 * green), round(255 * blue))


def _numbers(text: str) -> Array:
    return np.array([float(value) for value in text.split()])


def end_ball() -> trimesh.Trimesh:
    """A ball for an end of a measured distance."""
    return trimesh.creation.icosphere(subdivisions=1, radius=0.012)


def _solid(mesh: trimesh.Trimesh) -> Solid:
    return Solid(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))


def main() -> None:
    """Write all meshes to the standard output."""
    solids = Solids(
        robot=tuple(robot_parts(RobotModel().model)),
        end_ball=_solid(end_ball()),
    )
    pickle.dump(solids, sys.stdout.buffer)
