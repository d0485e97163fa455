"""Pieces that fall in the 3-D view, and are gone a second later, for a view that opens afterwards too."""

from dataclasses import dataclass

import numpy as np
import viser

from rolling_panda.messages.perception import Capsule
from server.scene.row import color_of, rods_mesh

#: A piece lies for a moment before it is gone: it falls, and fades from then on, for so long in all (s).
_FADES_S, _GONE_S = 0.6, 1.0
_GRAVITY = 9.81


@dataclass
class _Piece:
    handle: viser.MeshHandle
    begun: float
    #: How far it can fall (m).
    room: float


class SceneFall:
    """Lets pieces fall. `step` it often while it is `busy`."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Nothing falls yet."""
        self._server = server
        self._pieces: list[_Piece] = []
        self._number = 0

    @property
    def busy(self) -> bool:
        """Whether anything falls."""
        return bool(self._pieces)

    def drop(self, root: str, rods: list[Capsule], now: float, dim: bool = False, grow: float = 0.0) -> None:
        """Let rods fall from where they are.

        Args:
            root: Name of the layer that they belong to; who does not see that sees no fall.
            rods: In odom (m); at least one.
            now: Monotonic time (s).
            dim: As what nobody has perceived.
            grow: Drawn thicker by this (m).
        """
        vertices, faces = rods_mesh("cane", rods, grow)
        self._number += 1
        handle = self._server.scene.add_mesh_simple(
            f"{root}/falling{self._number}",
            vertices,
            faces,
            color=color_of("cane", dim),
            opacity=1.0,
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._pieces.append(_Piece(handle, now, max(float(vertices[:, 2].min()), 0.0)))

    def step(self, now: float) -> None:
        """Move everything on to `now` (monotonic, s)."""
        if not self._pieces:
            return
        with self._server.atomic():
            for piece in self._pieces:
                age = now - piece.begun
                if age >= _GONE_S:
                    piece.handle.remove()
                    continue
                down = min(0.5 * _GRAVITY * age**2, piece.room)
                piece.handle.position = np.array([0.0, 0.0, -down])
                piece.handle.opacity = min(1.0, (_GONE_S - age) / (_GONE_S - _FADES_S))
        self._pieces = [piece for piece in self._pieces if now - piece.begun < _GONE_S]
