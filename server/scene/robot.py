"""The robot in the 3-D view: as measured, as the ghost of a preview, and the trail of the tool."""

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import PreviewMotion, PreviewRow
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import configuration
from rolling_panda.model.wire_values import vector3
from server.scene.meshes import Color
from server.scene.outdoors import draw_shadow
from server.scene.solids import Part

_BASE_JOINT = "base_phi"
#: Smaller motions (m, and quaternion components) are not sent: they are invisible, and noise would be sent for ever.
_DEADBAND = 2e-5
#: The base's: odometry drifts by a third of a millimetre, and of a milliradian, at standstill.
_BASE_DEADBAND = 1e-3
#: Height of the base (m), and radius of the arm's rods (m).
_DECK, _ARM_RADIUS = 0.3, 0.075
_GHOST_COLOR, _GHOST_OPACITY = (120, 190, 255), 0.35
_TRAIL = "/trail/dots"
#: Distance between two dots of the trail, their size (m), and their largest number.
_TRAIL_STEP, _TRAIL_DOT, _TRAIL_POINTS = 0.025, 0.008, 60
_TRAIL_NEW, _TRAIL_OLD = np.array([255, 120, 60.0]), np.array([196, 176, 150.0])


class SceneRobot:
    """The robot as measured: one frame for each moving body, sent only when it has moved."""

    def __init__(self, server: viser.ViserServer, model: Any, parts: Sequence[Part]) -> None:
        """Put the bodies into the scene at q = 0; `model` is the Pinocchio model."""
        self._server = server
        self._model = model
        self._data = model.createData()
        self._base = int(model.getJointId(_BASE_JOINT))
        self._tool = int(model.getFrameId("tool"))
        self._where = MapFrame()
        names = {0: "", self._base: "/robot"}
        self._frames: dict[int, viser.FrameHandle] = {}
        self._sent: dict[int, Array] = {}
        for joint in range(self._base, model.njoints):
            if joint != self._base:
                names[joint] = f"{names[model.parents[joint]]}/{model.names[joint]}"
            self._frames[joint] = server.scene.add_frame(names[joint], show_axes=False)
        draw_shadow(server.scene, "/robot")
        self._parts = [part for part in parts if len(part.faces)]
        self._meshes: list[tuple[viser.MeshHandle, Color]] = []
        for number, part in enumerate(parts):
            handle = server.scene.add_mesh_simple(
                f"{names[part.joint]}/part{number}", part.vertices, part.faces, color=part.color
            )
            self._meshes.append((handle, part.color))
        self._grey = False

    def move(self, q: Array, where: MapFrame) -> bool:
        """Show the robot as measured; True when something was sent.

        Args:
            q: Configuration (12), with the base in odom.
            where: Where odom is in map.
        """
        pin.forwardKinematics(self._model, self._data, q)
        self._where = where
        moved = []
        for joint in self._frames:
            placement = self._placed(joint) if joint == self._base else self._data.liMi[joint]
            x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
            pose = np.array([*placement.translation, w, x, y, z])
            sent = self._sent.get(joint)
            deadband = _BASE_DEADBAND if joint == self._base else _DEADBAND
            if sent is None or float(np.abs(pose - sent).max()) > deadband:
                moved.append((joint, pose))
        if not moved:
            return False
        with self._server.atomic():
            for joint, pose in moved:
                self._sent[joint] = pose
                self._frames[joint].position = pose[:3]
                self._frames[joint].wxyz = pose[3:]
        return True

    @property
    def tool(self) -> tuple[Array, Array]:
        """Position of the tool (3, m) and the direction in which the blades point (3, unit), in map."""
        T_map_tool = self._where.pose_in_map(pin.updateFramePlacement(self._model, self._data, self._tool))
        return T_map_tool.translation.copy(), T_map_tool.rotation[:, 2].copy()

    def _placed(self, joint: int) -> Any:
        """T_map_joint (pin.SE3)."""
        return self._where.pose_in_map(self._data.oMi[joint])

    def rods(self) -> tuple[Capsule, ...]:
        """The arm as rods from joint to joint (map), to tell roughly what it hides."""
        places = [self._placed(joint).translation for joint in range(self._base + 1, self._model.njoints)]
        places = [*(place for place in places if place[2] > _DECK), self.tool[0]]
        return tuple(
            Capsule("post", vector3(a), vector3(b), _ARM_RADIUS, _ARM_RADIUS)
            for a, b in zip(places, places[1:], strict=False)
        )

    def triangles(self) -> Array:
        """Every triangle of the robot as drawn now (n×3×3, m, map)."""
        transformed = []
        for part in self._parts:
            T_map_joint = self._placed(part.joint)
            vertices = part.vertices @ T_map_joint.rotation.T + T_map_joint.translation
            transformed.append(vertices[part.faces])
        triangles: Array = np.concatenate(transformed)
        return triangles

    def set_grey(self, grey: bool) -> None:
        """Grey the robot while its posture is stale."""
        if grey == self._grey:
            return
        self._grey = grey
        with self._server.atomic():
            for handle, color in self._meshes:
                handle.color = _grey_of(color) if grey else color


class PreviewGhost:
    """The robot at a time of the preview or in another posture, see-through; each session has its own."""

    def __init__(self, model: Any, parts: Sequence[Part]) -> None:
        """Bind the robot's Pinocchio model and its meshes."""
        self._model, self._parts = model, parts
        self._data = model.createData()
        self._base = int(model.getJointId(_BASE_JOINT))
        #: What each owner sees: the configuration (12), and the hash of the preview whose path is drawn with it.
        self._shown: dict[str, tuple[Array, str]] = {}
        self._motion: PreviewMotion | None = None
        #: Hash of the preview whose path a view shows; empty without one.
        self._drawn: dict[int, str] = {}

    def set_motion(self, motion: PreviewMotion) -> None:
        """Show this motion from now on."""
        self._motion = motion

    def show(self, owner: str, time: float | None, clients: Sequence[viser.ClientHandle]) -> None:
        """Show the robot at a time of the preview (s) on the views of `owner`; None hides it."""
        if time is None or self._motion is None or not self._motion.rows:
            self.show_at(owner, None, clients)
        else:
            self._show(owner, configuration_at(self._motion.rows, time), self._motion.preview_hash, clients)

    def show_at(self, owner: str, q: Array | None, clients: Sequence[viser.ClientHandle]) -> None:
        """Show the robot at q (12) on the views of `owner`; None hides it."""
        if q is not None:
            self._show(owner, q, "", clients)
            return
        self._shown.pop(owner, None)
        for client in clients:
            client.scene.remove_by_name("/ghost")
            self._drawn.pop(client.client_id, None)

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """A view of `owner` has opened."""
        if owner in self._shown:
            self._show(owner, *self._shown[owner], [client])

    def detach(self, client_id: int) -> None:
        """A view has closed."""
        self._drawn.pop(client_id, None)

    def _show(self, owner: str, q: Array, path: str, clients: Sequence[viser.ClientHandle]) -> None:
        self._shown[owner] = q, path
        for client in clients:
            self._draw(client, q, path)

    def _draw(self, client: viser.ClientHandle, q: Array, path: str) -> None:
        if client.client_id not in self._drawn:
            self._drawn[client.client_id] = ""
            for joint in range(self._base, self._model.njoints):
                client.scene.add_frame(f"/ghost/{joint}", show_axes=False)
            for number, part in enumerate(self._parts):
                client.scene.add_mesh_simple(
                    f"/ghost/{part.joint}/part{number}",
                    part.vertices,
                    part.faces,
                    color=_GHOST_COLOR,
                    opacity=_GHOST_OPACITY,
                    cast_shadow=False,
                    receive_shadow=False,
                )
        if self._drawn[client.client_id] != path:
            self._drawn[client.client_id] = path
            tools = [row.tool for row in self._motion.rows] if path and self._motion is not None else []
            pairs = np.array(list(zip(tools, tools[1:], strict=False)), dtype=np.float32)
            if len(pairs):
                client.scene.add_line_segments(
                    "/ghost/tool", pairs, colors=_GHOST_COLOR, thickness=2.0, thickness_units="screen"
                )
            else:
                client.scene.remove_by_name("/ghost/tool")
        pin.forwardKinematics(self._model, self._data, q)
        with client.atomic():
            for joint in range(self._base, self._model.njoints):
                frame = client.scene.get_handle_by_name(f"/ghost/{joint}")
                if frame is not None:
                    placement = self._data.oMi[joint]
                    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
                    frame.position, frame.wxyz = placement.translation, np.array([w, x, y, z])


class ToolTrail:
    """The tool's last positions as dots that fade into the past, unlike a wire; sent only when there are more."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Start with an empty trail."""
        self._server = server
        self._positions: deque[m.Vector3] = deque(maxlen=_TRAIL_POINTS)

    def extend(self, position: m.Vector3) -> bool:
        """Add the tool's position (m, map); True when the trail has grown."""
        if self._positions and float(np.linalg.norm(np.subtract(position, self._positions[-1]))) < _TRAIL_STEP:
            return False
        self._positions.append(position)
        if len(self._positions) < 2:
            return True
        fade = np.linspace(0.0, 1.0, len(self._positions))[:, None]
        self._server.scene.add_point_cloud(
            _TRAIL,
            np.array(self._positions, dtype=np.float32),
            (_TRAIL_OLD + fade * (_TRAIL_NEW - _TRAIL_OLD)).astype(np.uint8),
            point_size=_TRAIL_DOT,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )
        return True


def configuration_at(rows: Sequence[PreviewRow], time: float) -> Array:
    """Configuration (12) at a time (s), interpolated between rows; the first or last one outside of them."""
    index = bisect_right([row.time for row in rows], time)
    a, b = rows[max(index - 1, 0)], rows[min(index, len(rows) - 1)]
    fraction = 0.0 if b.time <= a.time else min(max((time - a.time) / (b.time - a.time), 0.0), 1.0)
    q_a, q_b = configuration(a.base, a.position), configuration(b.base, b.position)
    q: Array = q_a + fraction * (q_b - q_a)
    return q


def _grey_of(color: Color) -> Color:
    level = round(60 + 0.3 * sum(color) / 3)
    return (level, level, level)
