"""Triangle mesh of a row for ray casting."""

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from bridge.sim.vineyard.row import Rod, Row
from rolling_panda.messages.types import WOOD_CLASSES

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]
#: Radius from which a rod has the finer cross-section (m), and the sides of either.
_THICK, _SIDES_THIN, _SIDES_THICK = 0.012, 8, 16


@dataclass(frozen=True)
class Hits:
    """First hits of rays: `rod` (N) is the index in `Row.rods` or -1, `distance` (N, m) is infinite where none."""

    rod: Indices
    distance: Floats


class RodMesh:
    """Mesh of the standing rods of one row revision."""

    def __init__(self, row: Row) -> None:
        """Mesh every standing rod."""
        # Rods of the rows behind have indices after those of this row.
        standing = [*row.standing(), *enumerate(row.backdrop, len(row.rods))]
        count = len(row.rods) + len(row.backdrop)
        self.revision = row.revision
        self.reachable = len(row.rods)
        self.kind = np.zeros(count, np.uint8)
        self.start = np.zeros((count, 3), np.float32)
        self.axis = np.zeros((count, 3), np.float32)
        self.width = np.zeros(count, np.float32)
        for index, rod in standing:
            self.kind[index] = WOOD_CLASSES.index(rod.kind)
            self.start[index] = rod.start
            self.width[index] = rod.start_radius + rod.end_radius
            self.axis[index] = (rod.end - rod.start) / max(float(np.linalg.norm(rod.end - rod.start)), 1e-9)
        thin = [(i, rod) for i, rod in standing if max(rod.start_radius, rod.end_radius) < _THICK]
        thick = [(i, rod) for i, rod in standing if max(rod.start_radius, rod.end_radius) >= _THICK]
        vertices, faces, owner, offset = [], [], [], 0
        for group, sides in ((thin, _SIDES_THIN), (thick, _SIDES_THICK)):
            if group:
                points, triangles = tubes([rod for _, rod in group], sides)
                vertices.append(points)
                faces.append(triangles + offset)
                offset += len(points)
                owner.append(np.repeat(np.array([i for i, _ in group], np.int32), len(triangles) // len(group)))
        self._owner = np.concatenate(owner) if owner else np.zeros(0, np.int32)
        self._scene = EmbreeScene() if owner else None
        if self._scene is not None:
            # The scene holds no reference to its geometry.
            self._geometry = TriangleMesh(self._scene, np.concatenate(vertices), np.concatenate(faces))

    def first_hits(self, origins: Floats, directions: Floats) -> Hits:
        """Cast rays: origins and directions (N, 3); distances are in units of each direction's length."""
        if self._scene is None:
            return Hits(np.full(len(origins), -1, np.int32), np.full(len(origins), np.inf, np.float32))
        result = self._scene.run(origins, directions, output=True)
        triangle = result["primID"]
        hit = triangle >= 0
        rod = np.where(hit, self._owner[np.where(hit, triangle, 0)], -1).astype(np.int32)
        return Hits(rod, np.where(hit, result["tfar"], np.inf).astype(np.float32))

    def occluded(self, origins: Floats, directions: Floats) -> NDArray[np.bool_]:
        """Whether rays hit anything (N): origins (N, 3) and directions (N, 3), or one for all (3)."""
        if self._scene is None or not len(origins):
            return np.zeros(len(origins), np.bool_)
        towards = np.ascontiguousarray(np.broadcast_to(directions, origins.shape))
        blocked: NDArray[np.bool_] = self._scene.run(origins, towards, query="OCCLUDED") >= 0
        return blocked


def tubes(rods: list[Rod], sides: int) -> tuple[Floats, Indices]:
    """Closed tapered prisms: vertices (N·(2·sides + 2), 3) and faces, the same number for each rod, rod by rod.

    A regular polygon is narrower than its circle seen from most sides, so the prism is wider by as much: its mean
    width is the rod's. The ends bulge by a third of the radius.
    """
    start, end = np.array([rod.start for rod in rods]), np.array([rod.end for rod in rods])
    radius = np.array([[rod.start_radius, rod.end_radius] for rod in rods]) * (np.pi / sides) / np.sin(np.pi / sides)
    axis = (end - start) / np.maximum(np.linalg.norm(end - start, axis=1, keepdims=True), 1e-9)
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(axis, across)
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * other[:, None]
    vertices = np.concatenate(
        [
            start[:, None] + radius[:, :1, None] * ring,
            end[:, None] + radius[:, 1:, None] * ring,
            (start - axis * radius[:, :1] / 3)[:, None],
            (end + axis * radius[:, 1:] / 3)[:, None],
        ],
        axis=1,
    )
    k = np.arange(sides)
    following = (k + 1) % sides
    first, second = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = np.concatenate(
        [
            np.stack([k, following, k + sides], 1),
            np.stack([following, following + sides, k + sides], 1),
            np.stack([following, k, first], 1),
            np.stack([k + sides, following + sides, second], 1),
        ]
    )
    offsets = np.arange(len(rods))[:, None, None] * (2 * sides + 2)
    return vertices.reshape(-1, 3).astype(np.float32), (faces + offsets).reshape(-1, 3).astype(np.int32)
