"""Cut canes in the 3-D view: the remaining part of each cane, and the fall of the severed part."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import viser

from rolling_panda import messages as m
from rolling_panda.messages.page import PagePoint
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.wire_values import vector3
from server.scene.meshes import capsules_mesh, color_of

Line = tuple[m.Vector3, ...]
#: Place of a cut (3, m, map) and the cane's direction there (3, unit, away from the cordon).
Cut = tuple[m.Vector3, m.UnitVector3]

#: A cut belongs to the line that it is nearest to, within this distance (m) and with this cosine of the angle or more.
_MAX_DISTANCE, _MIN_COSINE = 0.02, 0.6
#: A shorter piece beyond a cut (m) is within the error of the cut's position.
_MIN_LENGTH = 0.01
#: A falling piece fades from the first time on and is removed at the second (s).
_FADE_START_S, _LIFETIME_S = 0.6, 1.0
_GRAVITY = 9.81
#: Of what will fall, and of what falls.
FALLS_COLOR, FALLS_OPACITY = (214, 40, 40), 0.5


def cut_points(points: Iterable[PagePoint], bridge: m.BridgeState | None) -> dict[str, Cut]:
    """Points whose cane is cut: state DONE, or the bridge has just reported the cut.

    The controller checks a cut before it calls it done; a point whose cane still stands is left out again.

    Args:
        points: As the page shows them.
        bridge: The newest state; None before the first.
    """
    reported = bridge.cut_id if bridge is not None and bridge.outcome == "DONE" else ""
    return {
        row.point.point_id: (row.point.position, row.point.tangent)
        for row in points
        if row.entry.state == "DONE" or (row.entry.state == "CUTTING" and reported and row.entry.cut_id == reported)
    }


def will_fall(points: Iterable[PagePoint]) -> dict[str, Cut]:
    """The accepted cuts, beyond which a cane will fall."""
    return {
        row.point.point_id: (row.point.position, row.point.tangent)
        for row in points
        if row.entry.state in ("ACCEPTED", "CUTTING")
    }


def standing(lines: Sequence[Line], cuts: dict[str, Cut]) -> tuple[list[Line], dict[str, Line]]:
    """The part of each line below the cuts, and the part beyond each cut, by its name.

    Perception reports canes at full length until it has seen the cut, which it cannot while the robot works.

    Args:
        lines: Axes of canes, each from its base on (m, map).
        cuts: By name.
    """
    left = list(lines)
    off: dict[str, Line] = {}
    pairs = [(number, k) for number, line in enumerate(lines) for k in range(len(line) - 1)]
    if not pairs or not cuts:
        return left, off
    start = np.array([lines[number][k] for number, k in pairs])
    along = np.array([lines[number][k + 1] for number, k in pairs]) - start
    middle, reach = start + along / 2, float(np.linalg.norm(along, axis=1).max()) / 2 + _MAX_DISTANCE
    ends: dict[int, float] = {}
    for name, (position, direction) in cuts.items():
        near = np.flatnonzero(np.linalg.norm(middle - position, axis=1) <= reach)
        found = _nearest(start[near], along[near], np.array(position), np.array(direction))
        if found is None:
            continue
        number, k = pairs[near[found[0]]]
        at = k + found[1]
        if at < ends.get(number, np.inf):
            ends[number] = at
            below, beyond = _split(lines[number], at)
            left[number] = below
            if _length(beyond) > _MIN_LENGTH:
                off[name] = beyond
    return [line for line in left if len(line) > 1], off


def _nearest(start: Array, along: Array, position: Array, direction: Array) -> tuple[int, float] | None:
    """The segment nearest to a cut, and the fraction of its length there (0…1); None without one."""
    if not len(start):
        return None
    square = np.maximum((along * along).sum(axis=1), 1e-12)
    fraction = np.clip(((position - start) * along).sum(axis=1) / square, 0.0, 1.0)
    gap = np.linalg.norm(start + fraction[:, None] * along - position, axis=1)
    gap[along @ direction / np.sqrt(square) < _MIN_COSINE] = np.inf
    first = int(np.argmin(gap))
    return (first, float(fraction[first])) if gap[first] <= _MAX_DISTANCE else None


def _split(line: Line, at: float) -> tuple[Line, Line]:
    """Split a line at a vertex index with a fraction."""
    k = min(int(at), len(line) - 2)
    vertex = vector3(np.array(line[k]) + (at - k) * (np.array(line[k + 1]) - np.array(line[k])))
    below = line[: k + 1] if at == k else (*line[: k + 1], vertex)
    return below, (vertex, *line[k + 1 :])


def _length(line: Line) -> float:
    return float(np.linalg.norm(np.diff(np.array(line), axis=0), axis=1).sum())


def as_capsules(line: Line, radius: float) -> list[Capsule]:
    """A line as capsules of a radius (m)."""
    return [Capsule("cane", a, b, radius, radius) for a, b in zip(line, line[1:], strict=False)]


def removed_capsules(old: Sequence[Capsule], after: Sequence[Capsule]) -> list[Capsule]:
    """What a row has lost: whole capsules, and the ends of shortened ones."""
    new = {(capsule.kind, capsule.start): capsule for capsule in after}
    removed = []
    for capsule in old:
        remaining = new.get((capsule.kind, capsule.start))
        if remaining is None:
            removed.append(capsule)
        elif remaining.end != capsule.end:
            removed.append(Capsule(capsule.kind, remaining.end, capsule.end, remaining.end_radius, capsule.end_radius))
    return removed


@dataclass
class _Piece:
    handle: viser.MeshHandle
    started_at: float
    #: Height above the ground (m).
    height: float


class FallingPieces:
    """Animates cut pieces. Call `step` often."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Nothing falls yet."""
        self._server = server
        self._pieces: list[_Piece] = []
        self._number = 0

    def drop(self, root: str, capsules: list[Capsule], now: float, dim: bool = False) -> None:
        """Let capsules fall from where they are.

        Args:
            root: Node of the layer that they belong to; hidden with it.
            capsules: In map (m); at least one.
            now: Monotonic time (s).
            dim: Draw in the colours of the simulated row.
        """
        vertices, faces = capsules_mesh("cane", capsules)
        self._number += 1
        handle = self._server.scene.add_mesh_simple(
            f"{root}/falling{self._number}",
            vertices,
            faces,
            color=color_of("cane", dim) if dim else FALLS_COLOR,
            opacity=FALLS_OPACITY,
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._pieces.append(_Piece(handle, now, max(float(vertices[:, 2].min()), 0.0)))

    def step(self, now: float) -> None:
        """Move all pieces to where they are at `now` (monotonic, s)."""
        if not self._pieces:
            return
        with self._server.atomic():
            for piece in self._pieces:
                age = now - piece.started_at
                if age >= _LIFETIME_S:
                    piece.handle.remove()
                    continue
                down = min(0.5 * _GRAVITY * age**2, piece.height)
                piece.handle.position = np.array([0.0, 0.0, -down])
                piece.handle.opacity = FALLS_OPACITY * min(1.0, (_LIFETIME_S - age) / (_LIFETIME_S - _FADE_START_S))
        self._pieces = [piece for piece in self._pieces if now - piece.started_at < _LIFETIME_S]
