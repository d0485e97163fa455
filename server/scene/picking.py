"""Picking with the pointer: clicks into the 3-D view, ray casting, and the distance between two picked points."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import viser

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array
from server.scene.solids import Solid

#: A ray that passes the axis of a cane within this distance (m) picks it: a cane is thinner than a fingertip.
_TOLERANCE = 0.012
_TINY = 1e-12
_MEASURE = "/measure"
_COLOR = (255, 236, 110)
Clicked = Callable[[viser.SceneClickEvent], None]


class ClickListener:
    """Turns clicks into rays, on the views of the sessions that place points or measure, and on no others."""

    def __init__(self, on_ray: Callable[[str, m.Vector3, m.Vector3], object]) -> None:
        """`on_ray(owner, origin, direction)` is called on viser's thread, in map, for each click."""
        self._on_ray = on_ray
        self._listening: dict[str, dict[int, tuple[viser.ClientHandle, Clicked]]] = {}

    def listen(self, owner: str, clients: list[viser.ClientHandle]) -> None:
        """Listen to the clicks of `owner` from now on."""
        self._listening.setdefault(owner, {})
        for client in clients:
            self.attach(owner, client)

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """Listen to a view that has just opened, if its owner is listened to."""
        views = self._listening.get(owner)
        if views is None or client.client_id in views:
            return

        def clicked(event: viser.SceneClickEvent) -> None:
            self._on_ray(owner, event.ray_origin, event.ray_direction)

        client.scene.on_click()(clicked)
        views[client.client_id] = client, clicked

    def detach(self, client_id: int) -> None:
        """A view has closed."""
        for views in self._listening.values():
            views.pop(client_id, None)

    def stop(self, owner: str) -> None:
        """Listen to the clicks of `owner` no more."""
        for client, clicked in self._listening.pop(owner, {}).values():
            client.scene.remove_click_callback(clicked)


@dataclass(frozen=True)
class Ray:
    """From `origin` (3, m) along `direction` (3, unit)."""

    origin: Array
    direction: Array

    def at(self, distance: float) -> Array:
        """The point (3, m) at a distance (m)."""
        point: Array = self.origin + distance * self.direction
        return point


@dataclass(frozen=True)
class Hit:
    """The name of the picked surface, and its distance along the ray (m)."""

    distance: float
    surface: str


def nearest(hits: Iterable[Hit]) -> Hit | None:
    """The nearest hit; None without one."""
    finite = [hit for hit in hits if math.isfinite(hit.distance)]
    return min(finite, key=lambda hit: hit.distance, default=None)


def hit_rods(ray: Ray, rods: Sequence[Capsule]) -> Hit:
    """The first rod that a ray intersects, or nearly so; infinitely far without one."""
    if not rods:
        return Hit(math.inf, "")
    start, end = (np.array([getattr(rod, name) for rod in rods]) for name in ("start", "end"))
    radius = np.array([max(rod.start_radius, rod.end_radius) for rod in rods])
    axis, aside = end - start, ray.origin - start
    e = np.maximum((axis * axis).sum(axis=1), _TINY)
    b, c, f = axis @ ray.direction, aside @ ray.direction, (axis * aside).sum(axis=1)
    # Nearest on the line through the rod, then on the rod itself, then on the ray.
    along = (b * f - c * e) / np.maximum(e - b * b, _TINY)
    fraction = np.clip((b * along + f) / e, 0.0, 1.0)
    along = np.maximum(b * fraction - c, 0.0)
    gap = np.linalg.norm(aside + along[:, None] * ray.direction - fraction[:, None] * axis, axis=1)
    surface = along - np.sqrt(np.maximum(radius**2 - gap**2, 0.0))
    distance = np.where(gap <= np.maximum(radius, _TOLERANCE), np.maximum(surface, 0.0), np.inf)
    first = int(np.argmin(distance))
    return Hit(float(distance[first]), rods[first].kind)


def hit_triangles(ray: Ray, corners: Array, surface: str) -> Hit:
    """The first triangle (n×3×3, m) that a ray intersects from either side (Möller and Trumbore 1997)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ray.direction, ac)
    area = (ab * p).sum(axis=1)
    flat = np.abs(area) < _TINY
    scale = 1.0 / np.where(flat, 1.0, area)
    t = ray.origin - a
    u = (t * p).sum(axis=1) * scale
    q = np.cross(t, ab)
    v = (q @ ray.direction) * scale
    distance = (q * ac).sum(axis=1) * scale
    met = ~flat & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    return Hit(float(np.where(met, distance, np.inf).min(initial=math.inf)), surface)


def hit_ground(ray: Ray) -> Hit:
    """Where a ray intersects z = 0 from above."""
    down = float(-ray.direction[2])
    return Hit(float(ray.origin[2]) / down if down > 1e-6 and ray.origin[2] > 0.0 else math.inf, "ground")


@dataclass(frozen=True)
class PickedPoint:
    """A picked point (3, m, map), and the name of the surface there."""

    position: Array
    surface: str


class DistanceTool:
    """Measures the distance between two points that a session picks; a third one starts again."""

    def __init__(self, ball: Solid) -> None:
        """No session measures; `ball` is drawn at both ends."""
        self._ball = ball
        self._picked: dict[str, list[PickedPoint]] = {}

    def start(self, owner: str) -> None:
        """`owner` measures from now on."""
        self._picked.setdefault(owner, [])

    def add(
        self, owner: str, point: PickedPoint, clients: list[viser.ClientHandle]
    ) -> tuple[PickedPoint, PickedPoint] | None:
        """Add a point; returns both when there are two."""
        points = self._picked.get(owner)
        if points is None:
            return None
        if len(points) == 2:
            points.clear()
            for client in clients:
                _clear(client)
        points.append(point)
        for client in clients:
            _draw(client, points, self._ball)
        return (points[0], points[1]) if len(points) == 2 else None

    def stop(self, owner: str, clients: list[viser.ClientHandle]) -> None:
        """`owner` measures no more."""
        if self._picked.pop(owner, None) is not None:
            for client in clients:
                _clear(client)


def _draw(client: viser.ClientHandle, points: list[PickedPoint], ball: Solid) -> None:
    for number, point in enumerate(points):
        name = f"{_MEASURE}/end{number}"
        client.scene.add_mesh_simple(
            name,
            ball.vertices,
            ball.faces,
            color=_COLOR,
            position=point.position,
            cast_shadow=False,
            receive_shadow=False,
        )
    if len(points) < 2:
        return
    a, b = points[0].position, points[1].position
    client.scene.add_line_segments(
        f"{_MEASURE}/line", np.array([[a, b]], dtype=np.float32), colors=_COLOR, thickness=3.0, thickness_units="screen"
    )
    label = f"{float(np.linalg.norm(b - a)):.3f} m"
    client.scene.add_label(f"{_MEASURE}/label", label, position=0.5 * (a + b), anchor="bottom-center")


def _clear(client: viser.ClientHandle) -> None:
    for name in ("end0", "end1", "line", "label"):
        if client.scene.get_handle_by_name(f"{_MEASURE}/{name}") is not None:
            client.scene.remove_by_name(f"{_MEASURE}/{name}")
