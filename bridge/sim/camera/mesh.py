"""Triangle mesh of a row for ray casting."""

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from bridge.sim.vineyard.row import Array, Row
from rolling_panda.messages.types import WOOD_CLASSES

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]
_CLASS = {kind: number for number, kind in enumerate(WOOD_CLASSES)}
#: Radius from which a rod has the finer cross-section (m), the sides of either, and those of what grows on canes.
_THICK, _SIDES_THIN, _SIDES_THICK, _SIDES_ORGAN = 0.012, 8, 16, 5


@dataclass(frozen=True)
class Hits:
    """First hits of rays: `rod` (N) is the index in `Row.rods` or -1, `distance` (N, m) is infinite where none."""

    rod: Indices
    distance: Floats


class RodMesh:
    """Mesh of the standing rods of one row revision."""

    def __init__(self, row: Row) -> None:
        """Mesh every standing rod."""
        # What is visible only has indices after those of this row.
        visible = (*row.backdrop, *row.lying)
        standing = [*row.standing(), *enumerate(visible, len(row.rods))]
        count = len(row.rods) + len(visible)
        self.revision = row.revision
        self.reachable = len(row.rods)
        self.kind = np.zeros(count, np.uint8)
        self.start = np.zeros((count, 3), np.float32)
        self.axis = np.zeros((count, 3), np.float32)
        self.width = np.zeros(count, np.float32)
        rods = [rod for _, rod in standing]
        numbers = np.array([index for index, _ in standing], np.int32)
        start, end = (np.array([getattr(rod, name) for rod in rods]).reshape(-1, 3) for name in ("start", "end"))
        radius = np.array([(rod.start_radius, rod.end_radius) for rod in rods]).reshape(-1, 2)
        self.kind[numbers] = [_CLASS[rod.kind] for rod in rods]
        self.start[numbers] = start
        self.width[numbers] = radius.sum(axis=1)
        self.axis[numbers] = (end - start) / np.maximum(np.linalg.norm(end - start, axis=1, keepdims=True), 1e-9)
        sides = np.where(radius.max(axis=1, initial=0.0) < _THICK, _SIDES_THIN, _SIDES_THICK)
        sides[[rod.organ >= 0 for rod in rods]] = _SIDES_ORGAN
        vertices, faces, owner, offset = [], [], [], 0
        for each in (_SIDES_THIN, _SIDES_THICK, _SIDES_ORGAN):
            group = np.flatnonzero(sides == each)
            if len(group):
                points, triangles = tubes(start[group], end[group], radius[group], each)
                vertices.append(points)
                faces.append(triangles + offset)
                offset += len(points)
                owner.append(np.repeat(numbers[group], len(triangles) // len(group)))
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


def tubes(start: Array, end: Array, radius: Array, sides: int) -> tuple[Floats, Indices]:
    """Closed tapered prisms: vertices (N·(2·sides + 2), 3) and faces, the same number for each rod, rod by rod.

    A regular polygon is narrower than its circle seen from most sides, so the prism is wider by as much: its mean
    width is the rod's. The ends bulge by a third of the radius.

    Args:
        start: Of the axes (N×3, m).
        end: Of the axes (N×3, m).
        radius: At either end (N×2, m).
        sides: Of each prism.
    """
    radius = radius * (np.pi / sides) / np.sin(np.pi / sides)
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
    offsets = np.arange(len(start))[:, None, None] * (2 * sides + 2)
    return vertices.reshape(-1, 3).astype(np.float32), (faces + offsets).reshape(-1, 3).astype(np.int32)
