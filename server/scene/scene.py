"""The 3-D view: a viser server on a loopback port of its own, seen by browsers through the filtering proxy alone."""

from collections.abc import Callable, Collection, Iterable
from typing import Any, Protocol

import numpy as np
import viser

from rolling_panda import messages as m
from rolling_panda.messages.page import CameraPreset, Layer, PagePoint
from rolling_panda.messages.perception import Capsule, Obstacles, Scenery, SceneryMotion, UndecidedSite
from rolling_panda.messages.supervision import GizmoAxes
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.map_frame import MapFrame
from server.scene.camera_view import DecodedFrame, draw_frustum, draw_point_cloud, remove_camera_view
from server.scene.cameras import SceneCameras
from server.scene.cut_canes import (
    FALLS_COLOR,
    FALLS_OPACITY,
    Cut,
    FallingPieces,
    Line,
    as_capsules,
    cut_points,
    removed_capsules,
    standing,
    will_fall,
)
from server.scene.gizmo import SceneGizmos
from server.scene.markers import PointMarkers
from server.scene.meshes import capsules_mesh, color_of, drawn_kinds, on_the_ground
from server.scene.moved_canes import MovedCanes
from server.scene.outdoors import VineNumbers, draw_outdoors
from server.scene.picking import (
    ClickListener,
    DistanceTool,
    PickedPoint,
    Ray,
    hit_ground,
    hit_rods,
    hit_triangles,
    nearest,
)
from server.scene.robot import PreviewGhost, SceneRobot, ToolTrail
from server.scene.solids import Solids
from server.scene.viser_adapter.view_server import ViewServer

_CANES, _FALLS = "/plant/canes", "/plant/falls"
#: Radius of a perceived cane as drawn (m): thinner ones become dashes without antialiasing.
_CANE_RADIUS = 0.005
#: The fall is animated for at most this many cuts since the last message about the row.
_MAX_ANIMATED_CUTS = 5
#: Added to the radius of perceived capsules (m), which otherwise coincide with those of the simulated row.
_PERCEIVED_MARGIN = 0.002
#: Layers of a session that has not chosen any.
DEFAULT_LAYERS: frozenset[Layer] = frozenset({"plant", "points", "trail"})
#: Nodes of the layers that all views share; the other layers are drawn for each view.
_SHARED_LAYERS: dict[Layer, str] = {"plant": "/plant", "simulated": "/row", "trail": "/trail"}


class CallSoon(Protocol):
    """Has the server's loop call `function(*arguments)` soon; from any thread."""

    def __call__(self, function: Callable[..., object], *arguments: object) -> object:
        """Schedule the call."""


class Scene:
    """Everything that is drawn. Its methods run on the server's loop; viser's callbacks are scheduled there."""

    def __init__(
        self,
        model: Any,
        solids: Solids,
        call_soon: CallSoon,
        on_select: Callable[[str, str], object],
        on_ray: Callable[[str, m.Vector3, m.Vector3], object],
        on_refusal: Callable[[], object],
    ) -> None:
        """Start viser and draw the robot.

        Args:
            model: Pinocchio model of the robot.
            solids: Meshes of the robot and of the markers.
            call_soon: Schedules the callbacks below on the loop from which the scene is used.
            on_select: Called with (owner, point_id) when `owner` clicked a point.
            on_ray: Called with (owner, origin, direction) when `owner`, who places points or measures, clicked.
            on_refusal: Called when a connection that did not come through the proxy was refused.
        """
        self._call_soon = call_soon
        self.views = ViewServer(lambda: call_soon(on_refusal))
        self._server = self.views.viser
        self.gizmos = SceneGizmos()
        self._clicks = ClickListener(lambda *ray: call_soon(on_ray, *ray))
        self._on_select = on_select
        self.markers = PointMarkers(self._on_marker)
        self._points: dict[str, PagePoint] = {}
        self._canes: tuple[Line, ...] = ()
        self._standing: list[Line] = []
        #: The accepted cuts whose falling parts are drawn; None where the canes have changed since.
        self._drawn_falls: dict[str, Cut] | None = None
        self._cuts: dict[str, Cut] = {}
        self._uncut: set[str] = set()
        self._row: Scenery | None = None
        self._rods: dict[str, list[Capsule]] = {}
        self._selected: dict[str, str] = {}
        #: Flights of cameras to points that are not drawn yet, or of owners without an open view.
        self._pending_flights: dict[str, tuple[str, bool]] = {}
        self._plant: dict[str, list[Capsule]] = {}
        self._server.gui.configure_theme(dark_mode=False, show_logo=False, show_share_button=False)
        self._server.gui.main_panel.minimize()
        draw_outdoors(self._server.scene)
        self._numbers = VineNumbers(self._server.scene)
        for layer, name in _SHARED_LAYERS.items():
            self._server.scene.add_frame(name, show_axes=False, visible=layer in DEFAULT_LAYERS)
        self._layers: dict[str, frozenset[Layer]] = {}
        self.cameras = SceneCameras(self._server)
        self.trail = ToolTrail(self._server)
        self.falling = FallingPieces(self._server)
        self._moved = MovedCanes(self._server, "/row")
        self._distance_tool = DistanceTool(solids.end_ball)
        self.robot = SceneRobot(self._server, model, solids.robot)
        self.cameras.hides(self.robot.rods)
        self.ghost = PreviewGhost(model, solids.robot)
        self._server.on_client_connect(self._on_connect)
        self._server.on_client_disconnect(self._on_disconnect)

    def show_row(self, scenery: Scenery, now: float) -> None:
        """Draw the simulated row; kinds of capsules that did not change are not sent again. Severed pieces fall.

        Args:
            scenery: The row as it stands.
            now: Monotonic time (s).
        """
        before, self._row = self._row, scenery
        # A larger step of the revision is another row, or follows a long loss of messages.
        if before is not None and 0 < scenery.revision - before.revision <= _MAX_ANIMATED_CUTS:
            removed = removed_capsules(before.capsules, scenery.capsules)
            if removed:
                self.falling.drop("/row", removed, now, dim=True)
        if before is not None and scenery.capsules != before.capsules:
            self._moved.rest(before)
        self._show_capsules("/row", scenery.capsules, self._rods, dim=True)

    def show_row_motion(self, motion: SceneryMotion) -> None:
        """Draw the canes of the simulated row that wind and arm have displaced."""
        if self._row is not None:
            self._moved.show(self._row, motion)

    @property
    def shows_row(self) -> bool:
        """Whether any view shows the simulated row."""
        return self._shows({"simulated"})

    def show_plant(self, seen: Obstacles) -> None:
        """Draw posts, trunks, cordons, wires and canes as perceived; unchanged kinds are not sent again."""
        self._show_capsules("/plant", on_the_ground(seen.capsules), self._plant, grow=_PERCEIVED_MARGIN)

    def _show_capsules(
        self,
        root: str,
        capsules: Iterable[Capsule],
        drawn: dict[str, list[Capsule]],
        dim: bool = False,
        grow: float = 0.0,
    ) -> None:
        """Draw the kinds that have changed."""
        by_kind: dict[str, list[Capsule]] = {kind: [] for kind in drawn_kinds()}
        for capsule in capsules:
            if capsule.kind in by_kind:
                by_kind[capsule.kind].append(capsule)
        for kind in drawn_kinds():
            if by_kind[kind] == drawn.get(kind, []):
                continue
            drawn[kind] = by_kind[kind]
            if by_kind[kind]:
                vertices, faces = capsules_mesh(kind, by_kind[kind], grow)
                self._server.scene.add_mesh_simple(
                    f"{root}/{kind}",
                    vertices,
                    faces,
                    color=color_of(kind, dim),
                    receive_shadow=False,
                )
            else:
                self._server.scene.remove_by_name(f"{root}/{kind}")

    def show_points(self, points: tuple[PagePoint, ...], sites: tuple[UndecidedSite, ...] = ()) -> None:
        """Draw the pruning points by their state, and the sites that a person has to decide."""
        self._points = {row.point.point_id: row for row in points}
        self.markers.show(points, sites)
        self._numbers.show(points)
        self._draw_falls()
        self._start_pending_flights()

    def show_cuts(self, points: tuple[PagePoint, ...], bridge: m.BridgeState | None, now: float) -> None:
        """Draw canes up to their cuts; a piece that this scene has drawn before falls.

        Args:
            points: As the page shows them.
            bridge: The newest state; None before the first.
            now: Monotonic time (s).
        """
        cuts = cut_points(points, bridge)
        if cuts != self._cuts:
            new = {name for name in cuts if name not in self._cuts and name in self._uncut}
            self._cuts = cuts
            for name, line in self._draw_canes().items():
                if name in new:
                    self.falling.drop("/plant", as_capsules(line, _CANE_RADIUS), now)
        self._uncut = {row.point.point_id for row in points} - cuts.keys()

    def show_canes(self, canes: tuple[Line, ...]) -> None:
        """Draw the perceived canes, by their axes (polylines in map from the base on, m), up to their cuts."""
        if canes != self._canes:
            self._canes = canes
            self._draw_canes()

    def _draw_canes(self) -> dict[str, Line]:
        """Draw the standing parts; returns the parts beyond the cuts, by point."""
        self._standing, off = standing(self._canes, self._cuts)
        self._drawn_falls = None
        self._draw_falls()
        return off

    def _draw_falls(self) -> None:
        """Draw the standing canes as wood, and red and see-through what falls at the accepted cuts."""
        accepted = will_fall(self._points.values())
        if self._drawn_falls == accepted:
            return
        self._drawn_falls = accepted
        stays, falls = standing(self._standing, accepted)
        for name, lines, color, opacity in (
            (_CANES, stays, color_of("cane"), None),
            (_FALLS, list(falls.values()), FALLS_COLOR, FALLS_OPACITY),
        ):
            capsules = [capsule for line in lines for capsule in as_capsules(line, _CANE_RADIUS)]
            if not capsules:
                self._server.scene.remove_by_name(name)
                continue
            vertices, faces = capsules_mesh("cane", capsules)
            self._server.scene.add_mesh_simple(
                name, vertices, faces, color=color, opacity=opacity, flat_shading=False, cast_shadow=False,
                receive_shadow=False,
            )  # fmt: skip

    def select(self, owner: str, point_id: str) -> None:
        """Mark a point as selected on the views of `owner`; empty = none."""
        self._selected[owner] = point_id
        for client in self._clients(owner):
            self.markers.choose(client.client_id, point_id)

    def fly_to(self, owner: str, point_id: str, wait_for_user: bool = False) -> None:
        """Fly the cameras of the views of `owner` to a point; see `SceneCameras.fly`.

        Where the point is not drawn yet, or no view is open, the flight starts as soon as they are.
        """
        known, clients = self._points.get(point_id), self._clients(owner)
        if known is None or not clients:
            self._pending_flights[owner] = point_id, wait_for_user
            return
        self._pending_flights.pop(owner, None)
        self.cameras.fly(clients, np.array(known.point.position), wait_for_user)

    def _start_pending_flights(self) -> None:
        for owner, (point_id, wait_for_user) in list(self._pending_flights.items()):
            if point_id in self._points:
                self.fly_to(owner, point_id, wait_for_user)

    def step_cameras(self, now: float) -> None:
        """Move the cameras that fly to a point, and fit the markers to the cameras; `now` is monotonic (s)."""
        self.cameras.step(list(self._server.get_clients().values()), now)
        self.markers.step(now)

    def show_gizmo(self, owner: str, tool: m.Pose, axes: GizmoAxes = "tool") -> None:
        """Show the gizmo of `owner` at the tool (pose in map), along these axes."""
        self.gizmos.show(owner, tool, self._clients(owner), axes)

    def show_ghost(self, owner: str, time: float | None) -> None:
        """Show a time of the preview (s) on the views of `owner`; None hides it."""
        self.ghost.show(owner, time, self._clients(owner))

    def show_posture(self, owner: str, q: Array | None) -> None:
        """Show the robot at another configuration (12), see-through, on the views of `owner`; None hides it."""
        self.ghost.show_at(owner, q, self._clients(owner))

    def listen_to_clicks(self, owner: str, listening: bool) -> None:
        """Turn the clicks of `owner` into rays, or no more."""
        if listening:
            self._clicks.listen(owner, self._clients(owner))
        else:
            self._clicks.stop(owner)

    def place_camera(self, owner: str, preset: CameraPreset, q: Array, where: MapFrame) -> None:
        """Move the cameras of the views of `owner` to a preset; arguments as of `move`."""
        self.robot.move(q, where)
        self.cameras.apply_preset(preset, self._clients(owner), where.configuration_in_map(q), *self.robot.tool)

    def show_layers(self, owner: str, layers: Collection[Layer]) -> None:
        """Show `owner` these layers and no others."""
        clients = self._clients(owner)
        self._layers[owner] = frozenset(layers)
        for client in clients:
            self._apply_layers(owner, client)
            remove_camera_view(client, cloud="cloud" not in layers, frustum="camera" not in layers)

    @property
    def shows_camera_frames(self) -> bool:
        """Whether any view shows the frustum or the point cloud of the eye-in-hand camera."""
        return self._shows({"camera", "cloud"})

    def _shows(self, layers: set[Layer]) -> bool:
        owners = {self.views.owner(client_id) for client_id in self._server.get_clients()}
        return any(self._layers_of(owner) & layers for owner in owners if owner is not None)

    def show_camera_frame(self, frame: DecodedFrame, wxyz: Array, position: Array) -> None:
        """Draw a frame of the eye-in-hand camera, taken from a pose in map, on the views that show it."""
        for client_id, client in self._server.get_clients().items():
            owner = self.views.owner(client_id)
            layers = frozenset[Layer]() if owner is None else self._layers_of(owner)
            if "camera" in layers:
                draw_frustum(client, frame, wxyz, position)
            if "cloud" in layers:
                draw_point_cloud(client, frame, wxyz, position)

    def set_measuring(self, owner: str, measuring: bool) -> None:
        """`owner` measures distances from now on, or no more."""
        if measuring:
            self._distance_tool.start(owner)
        else:
            self._distance_tool.stop(owner, self._clients(owner))

    def measure(self, owner: str, origin: Array, direction: Array) -> tuple[PickedPoint, PickedPoint] | None:
        """`owner` clicked along a ray (map); returns both points after every second click."""
        ray, layers = Ray(origin, direction), self._layers_of(owner)
        rods = [rod for rows in self._plant.values() for rod in rows if "plant" in layers]
        if self._row is not None and "simulated" in layers:
            rods += self._moved.as_drawn(self._row)
        hit = nearest((hit_rods(ray, rods), hit_triangles(ray, self.robot.triangles(), "robot"), hit_ground(ray)))
        if hit is None:
            return None
        return self._distance_tool.add(owner, PickedPoint(ray.at(hit.distance), hit.surface), self._clients(owner))

    def forget(self, owner: str) -> None:
        """`owner` has signed out."""
        self._layers.pop(owner, None)
        self._distance_tool.stop(owner, [])
        self._selected.pop(owner, None)
        self._pending_flights.pop(owner, None)
        self.gizmos.hide(owner)
        self._clicks.stop(owner)

    def move(self, q: Array, where: MapFrame) -> bool:
        """Show the robot as measured; True when something was sent.

        Args:
            q: Configuration (12), with the base in odom.
            where: Where odom is in map.
        """
        in_map = where.configuration_in_map(q)
        self.gizmos.heading = float(in_map[2])
        moved = self.robot.move(q, where)
        self.cameras.follow(in_map, self.robot.tool[0])
        return moved

    def close(self) -> None:
        """Stop viser."""
        self.views.close()

    def _on_marker(self, client_id: int, point_id: str) -> None:
        owner = self.views.owner(client_id)
        if owner is not None:
            self._call_soon(self._on_select, owner, point_id)

    def _layers_of(self, owner: str) -> frozenset[Layer]:
        return self._layers.get(owner, DEFAULT_LAYERS)

    def _apply_layers(self, owner: str, client: viser.ClientHandle) -> None:
        shown = self._layers_of(owner)
        for layer, name in _SHARED_LAYERS.items():
            self.views.set_visible(client.client_id, name, layer in shown)
        self.markers.set_visible(client.client_id, "points" in shown)

    def _clients(self, owner: str) -> list[viser.ClientHandle]:
        clients = self._server.get_clients()
        return [client for client_id, client in clients.items() if self.views.owner(client_id) == owner]

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        self._call_soon(self._attach, client)

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        self._call_soon(self._detach, client.client_id)

    def _attach(self, client: viser.ClientHandle) -> None:
        owner = self.views.owner(client.client_id)
        if owner is not None:
            self.gizmos.attach(owner, client)
            self._clicks.attach(owner, client)
            visible, chosen = "points" in self._layers_of(owner), self._selected.get(owner, "")
            self.markers.attach(client, self.views.pixel_ratio(client.client_id), visible, chosen)
            self._apply_layers(owner, client)
            self.ghost.attach(owner, client)
            self._start_pending_flights()

    def _detach(self, client_id: int) -> None:
        self.gizmos.detach(client_id)
        self._clicks.detach(client_id)
        self.ghost.detach(client_id)
        self.markers.detach(client_id)
        self.cameras.forget(client_id)
