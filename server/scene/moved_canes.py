"""Canes of the simulated row in the 3-D view, as wind and arm displace them.

Meshes of the row at rest stay as they were sent. Rods that move are taken out of them and drawn in meshes of their own.
Of those only the vertices are sent again.
"""

import numpy as np
import viser

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, Scenery, SceneryMotion
from server.scene.meshes import capsules_mesh, color_of


class MovedCanes:
    """Draws the displaced rods of one row. In a row at rest it sends nothing."""

    def __init__(self, server: viser.ViserServer, root: str) -> None:
        """Nothing is displaced; `root` is the node of the row, whose meshes at rest are named by their kinds."""
        self._server, self._root = server, root
        #: Index in the row of each moving rod, by kind.
        self._moving: dict[m.WoodClass, list[int]] = {}
        self._handles: dict[m.WoodClass, viser.MeshHandle] = {}
        self._drawn: object = None
        self._moved: dict[int, Capsule] = {}

    def rest(self, row: Scenery) -> None:
        """Draw all rods at rest again, before the row changes; `row` is as it was drawn at rest."""
        for kind, moving in self._moving.items():
            if moving:
                self._take_out(row, kind, set())
        for handle in self._handles.values():
            handle.remove()
        self._moving, self._handles, self._drawn, self._moved = {}, {}, None, {}

    def show(self, row: Scenery, motion: SceneryMotion) -> None:
        """Draw the displaced rods; a motion of another revision of the row is left out.

        Args:
            row: As it was drawn at rest.
            motion: All of its displaced rods.
        """
        if motion is self._drawn or motion.revision != row.revision:
            return
        self._drawn = motion
        self._moved = {}
        moving: dict[m.WoodClass, list[int]] = {}
        for each in motion.moved:
            if each.index < len(row.capsules):
                rod = row.capsules[each.index]
                moving.setdefault(rod.kind, []).append(each.index)
                self._moved[each.index] = Capsule(rod.kind, each.start, each.end, rod.start_radius, rod.end_radius)
        for kind in sorted({*moving, *self._moving}):
            self._draw(row, kind, moving.get(kind, []))
        self._moving = moving

    def as_drawn(self, row: Scenery) -> list[Capsule]:
        """All capsules of the row (m, map), displaced or at rest."""
        return [self._moved.get(index, rod) for index, rod in enumerate(row.capsules)]

    def _draw(self, row: Scenery, kind: m.WoodClass, moving: list[int]) -> None:
        moved = [self._moved[index] for index in moving]
        if moving == self._moving.get(kind, []):
            self._handles[kind].vertices = capsules_mesh(kind, moved)[0]
            return
        with self._server.atomic():
            self._take_out(row, kind, set(moving))
            if moving:
                vertices, faces = capsules_mesh(kind, moved)
                self._handles[kind] = self._server.scene.add_mesh_simple(
                    f"{self._root}/moved {kind}",
                    vertices,
                    faces,
                    color=color_of(kind, dim=True),
                    receive_shadow=False,
                )
            else:
                self._handles.pop(kind).remove()

    def _take_out(self, row: Scenery, kind: m.WoodClass, moving: set[int]) -> None:
        """Shrink rods of the mesh at rest to a point each: its faces need not be sent again."""
        mesh = self._server.scene.get_handle_by_name(f"{self._root}/{kind}")
        assert isinstance(mesh, viser.MeshHandle)
        own = [(index, rod) for index, rod in enumerate(row.capsules) if rod.kind == kind]
        vertices = capsules_mesh(kind, [rod for _, rod in own])[0].reshape(len(own), -1, 3)
        out = np.array([index in moving for index, _ in own])
        vertices[out] = vertices[out, :1]
        mesh.vertices = vertices.reshape(-1, 3)
