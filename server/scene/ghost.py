"""The ghost of a preview in the 3-D view: the robot at a moment of it, see-through, and the line of the tool."""

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from rolling_panda.messages.supervision import PreviewMotion, PreviewRow
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import configuration
from server.scene.robot_meshes import Part

_BASE_JOINT = "base_phi"
_COLOR, _OPACITY = (120, 190, 255), 0.35
_LINE_COLOR = (120, 190, 255)


class SceneGhost:
    """Shown on the views of who looks at a preview, each at a moment of their own."""

    def __init__(self, model: Any, parts: list[Part]) -> None:
        """Bind the robot's Pinocchio model and its looks."""
        self._model, self._parts = model, parts
        self._data = model.createData()
        self._base = int(model.getJointId(_BASE_JOINT))
        self._times: dict[str, float] = {}
        self._motion: PreviewMotion | None = None
        self._lined: dict[int, str] = {}

    def shows(self, owner: str) -> bool:
        """Whether `owner` looks at a preview."""
        return owner in self._times

    def take(self, motion: PreviewMotion) -> None:
        """The motion to show from now on."""
        self._motion = motion

    def show(self, owner: str, time: float | None, clients: Sequence[viser.ClientHandle]) -> None:
        """Show the robot at a time of the preview (s) on the views of `owner`; None hides it."""
        if time is None or self._motion is None or not self._motion.rows:
            self._times.pop(owner, None)
            for client in clients:
                client.scene.remove_by_name("/ghost")
                self._lined.pop(client.client_id, None)
            return
        self._times[owner] = time
        for client in clients:
            self._draw(client, self._motion, moment(self._motion.rows, time))

    def attach(self, owner: str, client: viser.ClientHandle) -> None:
        """A view of `owner` has come."""
        if owner in self._times:
            self.show(owner, self._times[owner], [client])

    def detach(self, client_id: int) -> None:
        """A view has gone."""
        self._lined.pop(client_id, None)

    def _draw(self, client: viser.ClientHandle, motion: PreviewMotion, q: Array) -> None:
        if client.client_id not in self._lined:
            for joint in range(self._base, self._model.njoints):
                client.scene.add_frame(f"/ghost/{joint}", show_axes=False)
            for number, part in enumerate(self._parts):
                client.scene.add_mesh_simple(
                    f"/ghost/{part.joint}/part{number}",
                    part.vertices,
                    part.faces,
                    color=_COLOR,
                    opacity=_OPACITY,
                    cast_shadow=False,
                    receive_shadow=False,
                )
        if self._lined.get(client.client_id) != motion.preview_hash:
            self._lined[client.client_id] = motion.preview_hash
            tools = [row.tool for row in motion.rows]
            pairs = np.array(list(zip(tools, tools[1:], strict=False)), dtype=np.float32)
            if len(pairs):
                client.scene.add_line_segments(
                    "/ghost/tool", pairs, colors=_LINE_COLOR, thickness=2.0, thickness_units="screen"
                )
        pin.forwardKinematics(self._model, self._data, q)
        with client.atomic():
            for joint in range(self._base, self._model.njoints):
                frame = client.scene.get_handle_by_name(f"/ghost/{joint}")
                if frame is not None:
                    placement = self._data.oMi[joint]
                    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
                    frame.position, frame.wxyz = placement.translation, np.array([w, x, y, z])


def moment(rows: Sequence[PreviewRow], time: float) -> Array:
    """Configuration (12) at a time (s) between the rows; the first or last one outside of them."""
    after = bisect_right([row.time for row in rows], time)
    one, other = rows[max(after - 1, 0)], rows[min(after, len(rows) - 1)]
    share = 0.0 if other.time <= one.time else min(max((time - one.time) / (other.time - one.time), 0.0), 1.0)
    q, to = configuration(one.base, one.position), configuration(other.base, other.position)
    out: Array = q + share * (to - q)
    return out
