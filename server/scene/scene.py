"""The 3-D view: a viser server on a loopback port of its own, seen by browsers through the filtering proxy alone."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import viser

from rolling_panda import messages as m
from rolling_panda.messages.page import CameraPreset, GizmoAxes, Layer, PagePoint
from rolling_panda.messages.perception import Capsule, Obstacles, Scenery
from rolling_panda.model.differential_drive import Array
from server.scene.camera_view import Sight, draw_cloud, draw_frustum
from server.scene.camera_view import remove as remove_sight
from server.scene.cameras import SceneCameras
from server.scene.clicks import SceneClicks
from server.scene.door import SceneDoor
from server.scene.fall import SceneFall
from server.scene.ghost import SceneGhost
from server.scene.gizmo import SceneGizmos
from server.scene.layers import SceneLayers
from server.scene.markers import STATE_COLORS, beyond_marker, cut_marker, quat_wxyz_of_axis, selection_ring
from server.scene.measure import End, SceneMeasure
from server.scene.pace import pace_views, pause_s
from server.scene.pick import Ray, hit_ground, hit_rods, hit_triangles, nearest
from server.scene.robot import SceneRobot
from server.scene.robot_meshes import Part
from server.scene.row import color_of, drawn_kinds, rods_mesh
from server.scene.severed import Cut, Line, as_rods, cut_points, fallen_rods, standing
from server.scene.trail import SceneTrail
from server.scene.wake import wake_on_own_thread

VIEW_VERSION = viser.__version__
_SKY_TOP, _SKY_BOTTOM = np.array([22.0, 27.0, 34.0]), np.array([58.0, 66.0, 76.0])
_CANE_LINES = "/plant/canes"
_SELECTION = "/selection"
#: More cuts than this since the last picture of the row have not fallen before anybody's eyes.
_FEW_CUTS = 5
#: A line has no thickness; what falls of one has (m).
_FALLING_RADIUS = 0.004
#: What is perceived is drawn so much thicker (m) than the simulated row, so that it is seen where both are.
_ABOVE = 0.002
#: Lines of canes are drawn beside them, on the robot's side (m): inside the wood they could not be seen.
_BESIDE_CANE = np.array([0.0, -0.008, 0.0], dtype=np.float32)


def view_page() -> bytes:
    """The client's page: one self-contained HTML file."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()


class Soon(Protocol):
    """Has the server's loop call `function(*arguments)` soon; from any thread."""

    def __call__(self, function: Callable[..., object], *arguments: object) -> object:
        """Ask for it."""


class Scene:
    """Everything that is drawn. It belongs to the server's loop: what viser's thread tells is handed over to it."""

    def __init__(
        self,
        model: Any,
        parts: list[Part],
        soon: Soon,
        on_select: Callable[[str, str], object],
        on_sightline: Callable[[str, m.Vector3, m.Vector3], object],
        on_stranger: Callable[[], object],
    ) -> None:
        """Start viser and draw the robot.

        Args:
            model: Pinocchio model of the robot.
            parts: Its looks.
            soon: Hands over to the loop from which the scene is used, and on which all that follow are called.
            on_select: Called with (owner, point_id) when `owner` clicked a point.
            on_sightline: Called with (owner, origin, direction) when `owner`, who places points, clicked into the view.
            on_stranger: Called when a connection that did not come through the proxy was refused.
        """
        wake_on_own_thread()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self.port = int(self._server.get_port())
        self._soon = soon
        self.door = SceneDoor(self._server, lambda: soon(on_stranger))
        pace_views(self._server, lambda client_id: pause_s(self.views, self.door.looks_on(client_id)))
        self.gizmos = SceneGizmos()
        self._clicks = SceneClicks(lambda *line: soon(on_sightline, *line))
        self._on_select = on_select
        self._marker, self._beyond = cut_marker(), beyond_marker()
        self._points: dict[str, tuple[PagePoint, viser.MeshHandle]] = {}
        self._canes: tuple[Line, ...] = ()
        self._cuts: dict[str, Cut] = {}
        self._uncut: set[str] = set()
        self._row: Scenery | None = None
        self._rods: dict[str, list[Capsule]] = {}
        self._selected: dict[str, str] = {}
        #: Where cameras are to be brought once the point is drawn, and a view is open.
        self._awaited: dict[str, tuple[str, bool]] = {}
        self._plant: dict[str, list[Capsule]] = {}
        self._draw_surroundings()
        self.layers = SceneLayers(self._server)
        self.cameras = SceneCameras(self._server)
        self.trail = SceneTrail(self._server)
        self.fall = SceneFall(self._server)
        self._measure = SceneMeasure()
        self.robot = SceneRobot(self._server, model, parts)
        self.ghost = SceneGhost(model, parts)
        self._server.on_client_connect(self._on_client)
        self._server.on_client_disconnect(self._on_client_gone)

    def show_row(self, scenery: Scenery, now: float) -> None:
        """Draw the simulated row; kinds of rods that did not change are not sent again. What was severed since falls.

        Args:
            scenery: The row as it stands.
            now: Monotonic time (s).
        """
        before, self._row = self._row, scenery
        # One that is far ahead is another row, or one that was not heard of for long.
        if before is not None and 0 < scenery.revision - before.revision <= _FEW_CUTS:
            gone = fallen_rods(before.capsules, scenery.capsules)
            if gone:
                self.fall.drop("/row", gone, now, dim=True)
        self._show_rods("/row", scenery.capsules, self._rods, dim=True)

    def show_plant(self, seen: Obstacles) -> None:
        """Draw posts, trunks, cordons, wires and canes as perceived; likewise."""
        self._show_rods("/plant", seen.capsules, self._plant, grow=_ABOVE)

    def _show_rods(
        self,
        root: str,
        capsules: tuple[Capsule, ...],
        before: dict[str, list[Capsule]],
        dim: bool = False,
        grow: float = 0.0,
    ) -> None:
        rods: dict[str, list[Capsule]] = {kind: [] for kind in drawn_kinds()}
        for capsule in capsules:
            if capsule.kind in rods:
                rods[capsule.kind].append(capsule)
        for kind in drawn_kinds():
            if rods[kind] == before.get(kind, []):
                continue
            before[kind] = rods[kind]
            if rods[kind]:
                vertices, faces = rods_mesh(kind, rods[kind], grow)
                self._server.scene.add_mesh_simple(
                    f"{root}/{kind}",
                    vertices,
                    faces,
                    color=color_of(kind, dim),
                    flat_shading=True,
                    receive_shadow=False,
                )
            else:
                self._server.scene.remove_by_name(f"{root}/{kind}")

    def show_points(self, points: tuple[PagePoint, ...]) -> None:
        """Draw the pruning points, coloured by state; only what changed is sent."""
        shown = {row.point.point_id: row for row in points}
        with self._server.atomic():
            for point_id in [key for key in self._points if key not in shown]:
                self._points.pop(point_id)[1].remove()
            for point_id, row in shown.items():
                self._show_point(point_id, row)
        for owner in list(self._selected):
            self._draw_selection(owner)
        self._bring_awaited()

    def show_cuts(self, points: tuple[PagePoint, ...], bridge: m.BridgeState | None, now: float) -> None:
        """Canes are drawn up to where they were cut; what this scene has seen standing falls.

        Args:
            points: As the page is told of them.
            bridge: Its newest word; None before the first.
            now: Monotonic time (s).
        """
        cuts = cut_points(points, bridge)
        if cuts != self._cuts:
            new = {name for name in cuts if name not in self._cuts and name in self._uncut}
            self._cuts = cuts
            for name, line in self._draw_canes().items():
                if name in new:
                    self.fall.drop("/plant", as_rods(line, _FALLING_RADIUS), now)
        self._uncut = {row.point.point_id for row in points} - cuts.keys()

    def show_canes(self, canes: tuple[Line, ...]) -> None:
        """Draw the axes of the canes as perceived (polylines in odom from the base on, m), as far as they stand."""
        if canes != self._canes:
            self._canes = canes
            self._draw_canes()

    def _draw_canes(self) -> dict[str, Line]:
        """Draw what stands; what is beyond a cut, by its name."""
        left, off = standing(self._canes, self._cuts)
        pairs = [(a, b) for line in left for a, b in zip(line, line[1:], strict=False)]
        if pairs:
            self._server.scene.add_line_segments(
                _CANE_LINES,
                np.array(pairs, dtype=np.float32) + _BESIDE_CANE,
                colors=(84, 172, 224),
                thickness=2.0,
                thickness_units="screen",
            )
        else:
            self._server.scene.remove_by_name(_CANE_LINES)
        return off

    def select(self, owner: str, point_id: str) -> None:
        """Put the ring around a point on the views of `owner`; empty = none."""
        self._selected[owner] = point_id
        self._draw_selection(owner)

    def bring(self, owner: str, point_id: str, gently: bool = False) -> None:
        """Fly the cameras of the views of `owner` to a point; see `SceneCameras.fly`.

        Where the point is not drawn yet, or no view is open, that is done as soon as they are.
        """
        known, clients = self._points.get(point_id), self._clients(owner)
        if known is None or not clients:
            self._awaited[owner] = point_id, gently
            return
        self._awaited.pop(owner, None)
        self.cameras.fly(clients, np.array(known[0].point.position), gently)

    def _bring_awaited(self) -> None:
        for owner, (point_id, gently) in list(self._awaited.items()):
            if point_id in self._points:
                self.bring(owner, point_id, gently)

    def fly(self, now: float) -> None:
        """Take cameras that are on their way to a point further (s, monotonic)."""
        self.cameras.step(list(self._server.get_clients().values()), now)

    def show_gizmo(self, owner: str, tool: m.Pose, axes: GizmoAxes = "tool") -> None:
        """Show the gizmo of `owner` at the tool (pose in odom), along these axes."""
        self.gizmos.show(owner, tool, self._clients(owner), axes)

    def show_ghost(self, owner: str, time: float | None) -> None:
        """Show a moment of the preview (s) on the views of `owner`; None = nothing of it."""
        self.ghost.show(owner, time, self._clients(owner))

    def take_clicks(self, owner: str, taken: bool) -> None:
        """Take the clicks of `owner` anywhere into the view for lines of sight, or no more."""
        if taken:
            self._clicks.listen(owner, self._clients(owner))
        else:
            self._clicks.end(owner)

    def place_camera(self, owner: str, preset: CameraPreset, q: Array, tool: Array) -> None:
        """Put the cameras of the views of `owner` where a preset has them; robot at q (12), tool at a place (3)."""
        self.cameras.take(preset, self._clients(owner), q, tool)

    def show_layers(self, owner: str, layers: tuple[Layer, ...]) -> None:
        """Show `owner` these layers and no others."""
        clients = self._clients(owner)
        self.layers.choose(owner, layers, clients)
        for client in clients:
            remove_sight(client, cloud="cloud" not in layers, frustum="camera" not in layers)

    @property
    def views(self) -> int:
        """How many are open."""
        return len(self._server.get_clients())

    @property
    def sight_wanted(self) -> bool:
        """Whether any view shows what the camera on the hand sees."""
        owners = {self.door.owner(client_id) for client_id in self._server.get_clients()}
        return any(self.layers.of(owner) & {"camera", "cloud"} for owner in owners if owner is not None)

    def show_sight(self, sight: Sight, wxyz: Array, position: Array) -> None:
        """Draw what the camera on the hand saw from a pose in odom, for those who want it."""
        for client_id, client in self._server.get_clients().items():
            owner = self.door.owner(client_id)
            layers = frozenset[Layer]() if owner is None else self.layers.of(owner)
            if "camera" in layers:
                draw_frustum(client, sight, wxyz, position)
            if "cloud" in layers:
                draw_cloud(client, sight, wxyz, position)

    def begin_measure(self, owner: str, begun: bool) -> None:
        """`owner` measures from now on, or no more."""
        if begun:
            self._measure.begin(owner)
        else:
            self._measure.end(owner, self._clients(owner))

    def measure(self, owner: str, origin: Array, direction: Array) -> tuple[End, End] | None:
        """`owner` clicked along a line (odom); both ends after every second click."""
        ray, layers = Ray(origin, direction), self.layers.of(owner)
        rods = [rod for rows in self._plant.values() for rod in rows if "plant" in layers]
        rods += [rod for rows in self._rods.values() for rod in rows if "simulated" in layers]
        hit = nearest((hit_rods(ray, rods), hit_triangles(ray, self.robot.corners(), "robot"), hit_ground(ray)))
        if hit is None:
            return None
        return self._measure.take(owner, End(ray.at(hit.distance), hit.what), self._clients(owner))

    def forget(self, owner: str) -> None:
        """`owner` has signed out."""
        self.layers.forget(owner)
        self._measure.end(owner, [])
        self._selected.pop(owner, None)
        self._awaited.pop(owner, None)
        self.gizmos.hide(owner)
        self._clicks.end(owner)

    def move(self, q: Array) -> bool:
        """Show the robot at q (12); True when something was sent."""
        self.gizmos.heading = float(q[2])
        self.cameras.follow(q)
        return self.robot.move(q)

    def close(self) -> None:
        """Stop viser."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _show_point(self, point_id: str, row: PagePoint) -> None:
        color = STATE_COLORS[row.entry.state]
        wxyz = quat_wxyz_of_axis(row.point.tangent)
        beyond = row.entry.state == "UNREACHABLE"
        known = self._points.get(point_id)
        if known is None or (known[0].entry.state == "UNREACHABLE") != beyond:
            if known is not None:
                known[1].remove()
            shape = self._beyond if beyond else self._marker
            handle = self._server.scene.add_mesh_simple(
                f"/points/{point_id}",
                shape.vertices,
                shape.faces,
                color=color,
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
                position=row.point.position,
                wxyz=wxyz,
            )

            async def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
                owner = self.door.owner(event.client_id)
                if owner is not None:
                    self._soon(self._on_select, owner, point_id)

            handle.on_click(clicked)
        else:
            before, handle = known
            if before.entry.state != row.entry.state:
                handle.color = color
            if before.point.position != row.point.position:
                handle.position = row.point.position
            if before.point.tangent != row.point.tangent:
                handle.wxyz = wxyz
        self._points[point_id] = (row, handle)

    def _draw_selection(self, owner: str) -> None:
        shown = self._points.get(self._selected.get(owner, ""))
        for client in self._clients(owner):
            if shown is None:
                client.scene.remove_by_name(_SELECTION)
                continue
            point = shown[0].point
            ring = client.scene.get_handle_by_name(_SELECTION)
            if ring is None:
                shape = selection_ring()
                ring = client.scene.add_mesh_simple(
                    _SELECTION, shape.vertices, shape.faces, color=(255, 255, 255), cast_shadow=False
                )
            ring.position = point.position
            ring.wxyz = quat_wxyz_of_axis(point.tangent)

    def _clients(self, owner: str) -> list[viser.ClientHandle]:
        clients = self._server.get_clients()
        return [client for client_id, client in clients.items() if self.door.owner(client_id) == owner]

    async def _on_client(self, client: viser.ClientHandle) -> None:
        self._soon(self._attach, client)

    async def _on_client_gone(self, client: viser.ClientHandle) -> None:
        self._soon(self._detach, client.client_id)

    def _attach(self, client: viser.ClientHandle) -> None:
        owner = self.door.owner(client.client_id)
        if owner is not None:
            self.gizmos.attach(owner, client)
            self._clicks.attach(owner, client)
            self.layers.attach(owner, client)
            self._draw_selection(owner)
            self.ghost.attach(owner, client)
            self._bring_awaited()

    def _detach(self, client_id: int) -> None:
        self.gizmos.detach(client_id)
        self._clicks.detach(client_id)
        self.ghost.detach(client_id)
        self.cameras.forget(client_id)

    def _draw_surroundings(self) -> None:
        server, scene = self._server, self._server.scene
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        server.gui.main_panel.minimize()
        scene.world_axes.visible = False
        sky = _SKY_TOP + np.linspace(0.0, 1.0, 64)[:, None, None] * (_SKY_BOTTOM - _SKY_TOP)
        scene.set_background_image(np.repeat(sky, 4, axis=1).astype(np.uint8), format="png")
        # Light from all sides is two colours here: a picture of a sky around the scene costs twice as much to draw.
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        scene.add_light_hemisphere("/light/sky", intensity=1.6, sky_color=(214, 226, 244), ground_color=(108, 108, 92))
        scene.add_light_directional("/light/sun", intensity=2.6, color=(255, 244, 228), position=(-3.0, -4.0, 6.0))
        # The ground is the grid's own plane: one thing to draw instead of two that fill the picture.
        scene.add_grid(
            "/ground",
            width=120.0,
            height=120.0,
            position=(0.0, 0.0, -0.004),
            plane_color=(62, 69, 56),
            plane_opacity=1.0,
            cell_size=0.5,
            section_size=1.0,
            cell_color=(68, 76, 62),
            section_color=(76, 84, 70),
            fade_distance=50.0,
            fade_strength=0.5,
            shadow_opacity=0.0,
        )
