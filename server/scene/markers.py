"""The markers of pruning points: as large on the screen at every distance, and turned to the camera of each view."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from rolling_panda import messages as m
from rolling_panda.messages.page import PagePoint
from rolling_panda.messages.perception import UndecidedSite
from rolling_panda.model.differential_drive import Array
from server.scene.marker_shapes import HALO, MARKERS, SHAPE_OF, Flat, MarkerShape
from server.scene.meshes import STATE_COLORS, Color

#: Width of a marker and of the chosen one on the screen (CSS px).
MARKER_PX, CHOSEN_PX = 34.0, 48.0
#: A marker lies so far in front of the axis of its cane, towards the camera (m): the wood would cut through it.
_IN_FRONT = 0.012
#: Changes of a camera that are followed: of a distance (as a fraction), and of its direction (quaternion components).
_NEARER, _TURNED = 0.06, 0.04
#: Time between two updates of a view whose camera moves (s): all views share the link.
_PAUSE_S = 0.15
_ROOT: Final = "/markers"
_WHITE: Color = (255, 255, 255)
_DARK: Color = (24, 28, 32)
#: Brightness of the markers' colours under the scene's light.
_TINT = 0.62


class Camera(Protocol):
    """The camera of a view, as viser reports it: OpenCV's axes, `fov` vertical (rad), `image_height` in pixels."""

    position: Any
    wxyz: Any
    fov: float
    image_height: int


@dataclass(frozen=True)
class _Row:
    point_id: str
    position: m.Vector3
    color: Color


@dataclass
class _Drawn:
    """What a view shows: where its camera was, which markers, and the one that is chosen."""

    client: viser.ClientHandle
    pixel_ratio: float
    visible: bool = True
    chosen: str = ""
    position: Array | None = None
    wxyz: Array | None = None
    at: float = -math.inf
    stale: bool = True
    shapes: set[MarkerShape] = field(default_factory=set)


def tint_of(state: m.PointState) -> Color:
    """A state's colour, darkened: a marker faces the camera, and so the daylight, which would bleach it."""
    r, g, b = (round(_TINT * (value / 255.0) ** 1.6 * 255.0) for value in STATE_COLORS[state])
    return (r, g, b)


def scale_of(distance: NDArray[np.float64], fov: float, height_px: float, size_px: float) -> NDArray[np.float64]:
    """Sizes (m) of things that are `size_px` high on the screen.

    Args:
        distance: From the camera (n, m).
        fov: Vertical angle of view (rad).
        height_px: Height of the view, in the same pixels as `size_px`.
        size_px: On the screen.
    """
    out: NDArray[np.float64] = 2.0 * distance * math.tan(0.5 * fov) * size_px / max(height_px, 1.0)
    return out


class PointMarkers:
    """Draws the markers on every view. Called from the server's loop."""

    def __init__(self, on_click: Callable[[int, str], object]) -> None:
        """No point is known; `on_click(client_id, point_id)` is called on viser's thread."""
        self._on_click = on_click
        self._rows: dict[MarkerShape, tuple[_Row, ...]] = {}
        self._views: dict[int, _Drawn] = {}

    def attach(self, client: viser.ClientHandle, pixel_ratio: float, visible: bool, chosen: str) -> None:
        """A view has opened, which has so many pixels for each CSS pixel."""
        self._views[client.client_id] = _Drawn(client, pixel_ratio, visible, chosen)

    def detach(self, client_id: int) -> None:
        """A view has closed."""
        self._views.pop(client_id, None)

    def show(self, points: Iterable[PagePoint], sites: Iterable[UndecidedSite] = ()) -> None:
        """Show these points and, where a person has to decide, these sites."""
        rows: dict[MarkerShape, list[_Row]] = {}
        for each in points:
            state = each.entry.state
            row = _Row(each.point.point_id, each.point.position, tint_of(state))
            rows.setdefault(SHAPE_OF[state], []).append(row)
        for site in sites:
            if site.needs == "operator" and site.position is not None:
                rows.setdefault("decide", []).append(_Row("", site.position, tint_of("UNKNOWN")))
        shown = {shape: tuple(each) for shape, each in rows.items()}
        if shown != self._rows:
            self._rows = shown
            for view in self._views.values():
                view.stale = True

    def choose(self, client_id: int, point_id: str) -> None:
        """Mark a point in one view; empty for none."""
        view = self._views.get(client_id)
        if view is not None and view.chosen != point_id:
            view.chosen, view.stale = point_id, True

    def set_visible(self, client_id: int, visible: bool) -> None:
        """Show or hide all markers of one view."""
        view = self._views.get(client_id)
        if view is not None and view.visible is not visible:
            view.visible, view.stale = visible, True

    def step(self, now: float) -> None:
        """Fit the markers to cameras that have moved; `now` is monotonic (s)."""
        for view in self._views.values():
            camera: Camera = view.client.camera
            position, wxyz = np.array(camera.position, float), np.array(camera.wxyz, float)
            if not view.stale and (now - view.at < _PAUSE_S or not self._moved(view, position, wxyz)):
                continue
            view.position, view.wxyz, view.at, view.stale = position, wxyz, now, False
            self._draw(view, camera)

    def _moved(self, view: _Drawn, position: Array, wxyz: Array) -> bool:
        if view.position is None or view.wxyz is None:
            return True
        if min(float(np.abs(wxyz - view.wxyz).max()), float(np.abs(wxyz + view.wxyz).max())) > _TURNED:
            return True
        way = float(np.linalg.norm(position - view.position))
        places = [row.position for rows in self._rows.values() for row in rows]
        if way < 1e-4 or not places:
            return False
        nearest = float(np.linalg.norm(np.array(places) - view.position, axis=1).min())
        return way > _NEARER * max(nearest, 0.05)

    def _draw(self, view: _Drawn, camera: Camera) -> None:
        rows: Mapping[MarkerShape, tuple[_Row, ...]] = self._rows if view.visible else {}
        height = max(camera.image_height, 1) / view.pixel_ratio
        with view.client.atomic():
            for shape in view.shapes - rows.keys():
                for layer in ("glass", "tint", "white"):
                    view.client.scene.remove_by_name(f"{_ROOT}/{shape}/{layer}")
            view.shapes = set(rows)
            halo = None
            for shape, each in rows.items():
                places, sizes = self._placed(view, each, camera, height)
                self._draw_shape(view, shape, each, places, sizes)
                for row, place, size in zip(each, places, sizes.tolist(), strict=True):
                    if row.point_id and row.point_id == view.chosen:
                        halo = place, size
            self._draw_halo(view, halo)

    def _placed(
        self, view: _Drawn, rows: tuple[_Row, ...], camera: Camera, height: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Places (n×3, m, map) and sizes (n, m)."""
        places = np.array([row.position for row in rows], float)
        away = np.array(camera.position, float) - places
        distance = np.maximum(np.linalg.norm(away, axis=1), 0.02)
        places += away * (np.minimum(_IN_FRONT, 0.5 * distance) / distance)[:, None]
        size_px = np.array([CHOSEN_PX if row.point_id and row.point_id == view.chosen else MARKER_PX for row in rows])
        return places.astype(np.float32), scale_of(distance, camera.fov, height, 1.0) * size_px

    def _draw_shape(
        self,
        view: _Drawn,
        shape: MarkerShape,
        rows: tuple[_Row, ...],
        places: NDArray[np.float32],
        sizes: NDArray[np.float64],
    ) -> None:
        marker, colors = MARKERS[shape], np.array([row.color for row in rows], np.uint8)
        wxyzs = np.tile(np.array(view.wxyz, np.float32), (len(rows), 1))
        white = np.tile(np.array(_WHITE, np.uint8), (len(rows), 1))
        ids = tuple(row.point_id for row in rows)
        layers: list[tuple[str, Flat, NDArray[np.uint8], float]] = [
            ("white", marker.white, white, 1.0),
            ("tint", marker.tint, colors, 1.0),
        ]
        if marker.glass is not None:
            layers.append(("glass", marker.glass, colors, 0.25))
        for layer, flat, color, opacity in layers:
            self._draw_layer(view, f"{_ROOT}/{shape}/{layer}", flat, ids, places, wxyzs, sizes, color, opacity)

    def _draw_layer(
        self,
        view: _Drawn,
        name: str,
        flat: Flat,
        ids: tuple[str, ...],
        places: NDArray[np.float32],
        wxyzs: NDArray[np.float32],
        sizes: NDArray[np.float64],
        colors: NDArray[np.uint8],
        opacity: float,
    ) -> None:
        handle: Any = view.client.scene.get_handle_by_name(name)
        if handle is not None and len(handle.batched_positions) == len(ids):
            handle.batched_positions, handle.batched_wxyzs = places, wxyzs
            handle.batched_scales = sizes.astype(np.float32)
            handle.batched_colors = colors
            return
        handle = view.client.scene.add_batched_meshes_simple(
            name,
            flat.vertices,
            flat.faces,
            batched_positions=places,
            batched_wxyzs=wxyzs,
            batched_scales=sizes.astype(np.float32),
            batched_colors=colors,
            opacity=None if opacity == 1.0 else opacity,
            lod="off",
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        client_id = view.client.client_id
        shape = name.split("/")[2]

        async def clicked(event: Any) -> None:
            rows = self._rows.get(shape, ())  # type: ignore[call-overload]
            number = event.instance_index
            if number is not None and number < len(rows) and rows[number].point_id:
                self._on_click(client_id, rows[number].point_id)

        handle.on_click(clicked)

    def _draw_halo(self, view: _Drawn, at: tuple[NDArray[np.float32], float] | None) -> None:
        for name, flat, color in (("halo", HALO[0], _WHITE), ("shade", HALO[1], _DARK)):
            path = f"{_ROOT}/{name}"
            if at is None:
                view.client.scene.remove_by_name(path)
                continue
            handle: Any = view.client.scene.get_handle_by_name(path)
            if handle is None:
                handle = view.client.scene.add_mesh_simple(
                    path, flat.vertices, flat.faces, color=color, side="double", flat_shading=True,
                    cast_shadow=False, receive_shadow=False,
                )  # fmt: skip
            handle.position, handle.wxyz, handle.scale = at[0], view.wxyz, at[1]
