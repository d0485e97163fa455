"""The robot in the 3-D view: one frame a moving body, sent only when it has moved."""

from typing import Any

import numpy as np
import pinocchio as pin
import viser

from rolling_panda.model.differential_drive import Array
from server.scene.robot_meshes import Color, Part

_BASE_JOINT = "base_phi"
#: Smaller movements (m, and quaternion parts) are not sent: they cannot be seen, and noise would never let it rest.
_STILL = 2e-5
#: Likewise of the base, where odometry wanders by a third of a millimetre, and of a milliradian, while it stands still.
_BASE_STILL = 1e-3


class SceneRobot:
    """Draws the robot and moves it."""

    def __init__(self, server: viser.ViserServer, model: Any, parts: list[Part]) -> None:
        """Put the bodies into the scene at q = 0; `model` is the Pinocchio model."""
        self._server = server
        self._model = model
        self._data = model.createData()
        self._base = int(model.getJointId(_BASE_JOINT))
        names = {0: "", self._base: "/robot"}
        self._frames: dict[int, viser.FrameHandle] = {}
        self._sent: dict[int, Array] = {}
        for joint in range(self._base, model.njoints):
            if joint != self._base:
                names[joint] = f"{names[model.parents[joint]]}/{model.names[joint]}"
            self._frames[joint] = server.scene.add_frame(names[joint], show_axes=False)
        self._parts = [part for part in parts if len(part.faces)]
        self._meshes: list[tuple[viser.MeshHandle, Color]] = []
        for number, part in enumerate(parts):
            handle = server.scene.add_mesh_simple(
                f"{names[part.joint]}/part{number}", part.vertices, part.faces, color=part.color
            )
            self._meshes.append((handle, part.color))
        self._grey = False

    def move(self, q: Array) -> bool:
        """Show the robot at q (12); True when something was sent."""
        pin.forwardKinematics(self._model, self._data, q)
        moved = []
        for joint in self._frames:
            placement = self._data.oMi[joint] if joint == self._base else self._data.liMi[joint]
            x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
            pose = np.array([*placement.translation, w, x, y, z])
            sent = self._sent.get(joint)
            still = _BASE_STILL if joint == self._base else _STILL
            if sent is None or float(np.abs(pose - sent).max()) > still:
                moved.append((joint, pose))
        if not moved:
            return False
        with self._server.atomic():
            for joint, pose in moved:
                self._sent[joint] = pose
                self._frames[joint].position = pose[:3]
                self._frames[joint].wxyz = pose[3:]
        return True

    def corners(self) -> Array:
        """Every triangle of the robot where it is drawn now (n×3×3, m, odom)."""
        placed = []
        for part in self._parts:
            where = self._data.oMi[part.joint]
            vertices = part.vertices @ where.rotation.T + where.translation
            placed.append(vertices[part.faces])
        corners: Array = np.concatenate(placed)
        return corners

    def set_grey(self, grey: bool) -> None:
        """Grey the robot while what is shown is only its last known state."""
        if grey == self._grey:
            return
        self._grey = grey
        with self._server.atomic():
            for handle, color in self._meshes:
                handle.color = _greyed(color) if grey else color


def _greyed(color: Color) -> Color:
    level = round(60 + 0.3 * sum(color) / 3)
    return (level, level, level)
