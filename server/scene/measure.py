"""The distance between two places that were clicked, drawn on the views of the session that measures."""

from dataclasses import dataclass

import numpy as np
import trimesh
import viser

from rolling_panda.model.differential_drive import Array

_NAME = "/measure"
_COLOR = (255, 236, 110)


@dataclass(frozen=True)
class End:
    """A place that was clicked (3, m, odom), and what is there."""

    place: Array
    what: str


class SceneMeasure:
    """Keeps the ends of each session that measures. A third click begins anew."""

    def __init__(self) -> None:
        """Nobody measures."""
        self._ends: dict[str, list[End]] = {}

    def begin(self, owner: str) -> None:
        """`owner` measures from now on."""
        self._ends.setdefault(owner, [])

    def take(self, owner: str, end: End, clients: list[viser.ClientHandle]) -> tuple[End, End] | None:
        """One more end; both when there are two."""
        ends = self._ends.get(owner)
        if ends is None:
            return None
        if len(ends) == 2:
            ends.clear()
            for client in clients:
                _clear(client)
        ends.append(end)
        for client in clients:
            _draw(client, ends)
        return (ends[0], ends[1]) if len(ends) == 2 else None

    def end(self, owner: str, clients: list[viser.ClientHandle]) -> None:
        """`owner` measures no more."""
        if self._ends.pop(owner, None) is not None:
            for client in clients:
                _clear(client)


def _draw(client: viser.ClientHandle, ends: list[End]) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.012)
    for number, end in enumerate(ends):
        name = f"{_NAME}/end{number}"
        client.scene.add_mesh_simple(
            name, ball.vertices, ball.faces, color=_COLOR, position=end.place, cast_shadow=False, receive_shadow=False
        )
    if len(ends) < 2:
        return
    a, b = ends[0].place, ends[1].place
    client.scene.add_line_segments(
        f"{_NAME}/line", np.array([[a, b]], dtype=np.float32), colors=_COLOR, thickness=3.0, thickness_units="screen"
    )
    words = f"{float(np.linalg.norm(b - a)):.3f} m"
    client.scene.add_label(f"{_NAME}/words", words, position=0.5 * (a + b), anchor="bottom-center")


def _clear(client: viser.ClientHandle) -> None:
    for name in ("end0", "end1", "line", "words"):
        if client.scene.get_handle_by_name(f"{_NAME}/{name}") is not None:
            client.scene.remove_by_name(f"{_NAME}/{name}")
