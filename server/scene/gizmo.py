"""The gizmos of the 3-D view: one a session, shown on that session's views alone."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from rolling_panda import messages as m
from rolling_panda.messages.supervision import GizmoAxes
from rolling_panda.model.robot import placement
from server.scene.viser_adapter.view_server import adopt_pose

#: Length of the gizmo's arrows, seen from the side (CSS px).
GIZMO_PX = 110.0
_NAME = "/gizmo"
#: An undragged gizmo follows the tool; smaller motions (m, quaternion components) are not sent.
_DEADBAND = 1e-3


@dataclass
class _Gizmo:
    """A session's gizmo: `drawn` is the rotation of its arrows in map, `offset` that of the tool in its arrows."""

    pose: m.Pose
    axes: GizmoAxes = "tool"
    drawn: Any = field(default_factory=pin.Quaternion.Identity)
    offset: Any = field(default_factory=pin.Quaternion.Identity)
    dragged: bool = False
    handles: dict[int, viser.TransformControlsHandle] = field(default_factory=dict)


class SceneGizmos:
    """Shows gizmos and computes their dragged poses. Called from the server's loop."""

    def __init__(self) -> None:
        """No gizmo is shown."""
        self._gizmos: dict[str, _Gizmo] = {}
        self.heading = 0.0
        """Of the base in map (rad), for gizmos along its axes."""

    def shown(self, owner: str) -> bool:
        """Whether this session's gizmo is shown."""
        return owner in self._gizmos

    def show(self, owner: str, pose: m.Pose, clients: list[viser.ClientHandle], axes: GizmoAxes = "tool") -> None:
        """Show the gizmo of `owner` at a pose in map on these views, its arrows along these axes."""
        gizmo = self._gizmos.setdefault(owner, _Gizmo(pose))
        gizmo.axes = axes
        self._place(gizmo, pose)
        for client in clients:
            self.attach(owner, client)

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """Add the gizmo of `owner`, if it is shown, to a view that has just opened."""
        gizmo = self._gizmos.get(owner)
        if gizmo is None or client.client_id in gizmo.handles:
            return
        handle = client.scene.add_transform_controls(
            _NAME,
            # The same size on the screen (px) at every distance, so that a finger can grab it.
            fixed=True,
            scale=GIZMO_PX,
            line_width=4.0,
            depth_test=False,
            wxyz=_wxyz(gizmo.drawn),
            position=gizmo.pose.position,
        )
        gizmo.handles[client.client_id] = handle

    def drag(self, owner: str, position: m.Vector3, wxyz: tuple[float, float, float, float]) -> m.Pose | None:
        """`owner` has dragged the arrows to here in map; returns the target pose of the tool, None without one."""
        gizmo, drawn = self._gizmos.get(owner), pin.Quaternion(*wxyz)
        if gizmo is None or drawn.norm() < 1e-9:
            return None
        for handle in gizmo.handles.values():
            adopt_pose(handle, position, wxyz)
        drawn.normalize()
        gizmo.drawn = drawn
        qx, qy, qz, qw = ((drawn * gizmo.offset).coeffs()).tolist()
        gizmo.pose, gizmo.dragged = m.Pose(position, (qx, qy, qz, qw)), True
        return gizmo.pose

    def detach(self, client_id: int) -> None:
        """A view has closed."""
        for gizmo in self._gizmos.values():
            gizmo.handles.pop(client_id, None)

    def hide(self, owner: str) -> None:
        """Remove the gizmo of `owner`."""
        gizmo = self._gizmos.pop(owner, None)
        if gizmo is not None:
            for handle in gizmo.handles.values():
                handle.remove()

    def follow(self, tool: m.Pose, holder: str | None) -> None:
        """Move every undragged gizmo to the tool, except that of `holder`."""
        for owner, gizmo in self._gizmos.items():
            if owner != holder and not gizmo.dragged and _difference(gizmo.pose, tool) > _DEADBAND:
                self._place(gizmo, tool)

    def reset(self, owner: str, tool: m.Pose | None) -> None:
        """Return a gizmo to the tool; where the tool's pose is unknown, it follows once it is known."""
        gizmo = self._gizmos.get(owner)
        if gizmo is not None:
            gizmo.dragged = False
            if tool is not None:
                self._place(gizmo, tool)

    def pose(self, owner: str) -> m.Pose | None:
        """Pose of the tool at the gizmo of `owner` in map; None without one."""
        gizmo = self._gizmos.get(owner)
        return None if gizmo is None else gizmo.pose

    def _place(self, gizmo: _Gizmo, pose: m.Pose) -> None:
        gizmo.pose, gizmo.dragged = pose, False
        tool = pin.Quaternion(placement(pose).rotation)
        heading = 0.5 * self.heading
        base = pin.Quaternion(math.cos(heading), 0.0, 0.0, math.sin(heading))
        gizmo.drawn = {"tool": tool, "base": base, "world": pin.Quaternion.Identity()}[gizmo.axes]
        gizmo.offset = gizmo.drawn.inverse() * tool
        for handle in gizmo.handles.values():
            handle.position = pose.position
            handle.wxyz = _wxyz(gizmo.drawn)


def _wxyz(quaternion: Any) -> tuple[float, float, float, float]:
    return (quaternion.w, quaternion.x, quaternion.y, quaternion.z)


def _difference(a: m.Pose, b: m.Pose) -> float:
    return float(np.abs(np.array([*a.position, *a.quat_xyzw]) - np.array([*b.position, *b.quat_xyzw])).max())
