"""Where a view's camera stands: presets, each for the views of the one who asked, and one that goes along."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import viser

from rolling_panda.differential_drive import Array
from rolling_panda.page_messages import CameraPreset

#: A camera that goes along is moved when the base has gone so far (m).
_STEP = 0.004
#: Where a new view begins is told anew when the base has gone so far (m) or turned so far (rad).
_BEGIN_STEP = 0.3
#: A view reports its camera late. Farther than this (m) from each place where it was put, somebody has moved it.
_ECHO = 0.03


@dataclass(frozen=True)
class Shot:
    """Where a camera stands and where it looks (3 each, m, odom)."""

    position: Array
    look_at: Array


def shot(preset: CameraPreset, q: Array, tool: Array) -> Shot:
    """Where a preset puts the camera.

    Args:
        preset: `follow` looks over the robot along the row and goes along with the base; `row` stands back to see some
            vines; `tool` is near the tool; `top` looks down on robot and row.
        q: Configuration of the robot (12).
        tool: Place of the tool (3, m, odom).
    """
    base = np.array([q[0], q[1], 0.0])
    c, s = math.cos(q[2]), math.sin(q[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    if preset == "tool":
        return Shot(tool + turn @ [-0.45, -0.6, 0.35], tool)
    position, look_at = {
        "follow": ([-1.45, -1.95, 1.85], [0.3, 0.45, 0.8]),
        "row": ([0.6, -3.6, 1.9], [0.6, 0.7, 0.9]),
        "top": ([0.3, 0.0, 4.6], [0.3, 0.35, 0.6]),
    }[preset]
    return Shot(base + turn @ position, base + turn @ look_at)


@dataclass
class _Along:
    client: viser.ClientHandle
    base: Array
    offset: Array
    gaze: Array
    put: deque[Array] = field(default_factory=lambda: deque(maxlen=60))


class SceneCameras:
    """Moves the cameras of views, and says where new ones begin: near the robot. Called from the server's loop."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Every camera stands where its owner leaves it."""
        self._along: dict[int, _Along] = {}
        self._begin = server.initial_camera
        self._begin.fov = 0.82
        self._begun = np.full(3, np.inf)
        self._begin_near(np.zeros(3))

    def take(self, preset: CameraPreset, clients: list[viser.ClientHandle], q: Array, tool: Array) -> None:
        """Put the cameras of these views where `preset` has them."""
        wanted = shot(preset, q, tool)
        for client in clients:
            self._along.pop(client.client_id, None)
            client.camera.up_direction = (0.0, 0.0, 1.0)
            _put(client, wanted.position, wanted.look_at)
            if preset == "follow":
                base = np.array([q[0], q[1], 0.0])
                along = _Along(client, base, wanted.position - base, wanted.look_at - base)
                along.put.append(wanted.position)
                self._along[client.client_id] = along

    def follow(self, q: Array) -> None:
        """Take along the cameras that follow the base; whoever turns or moves theirs keeps it so, going along."""
        self._begin_near(q[:3])
        base = np.array([q[0], q[1], 0.0])
        for along in list(self._along.values()):
            camera = along.client.camera
            position = np.array(camera.position)
            if min(float(np.abs(position - put).max()) for put in along.put) > _ECHO:
                along.offset, along.gaze = position - along.base, np.array(camera.look_at) - along.base
                along.put.append(position)
            if float(np.abs(base - along.base).max()) < _STEP:
                continue
            along.base = base
            along.put.append(base + along.offset)
            _put(along.client, base + along.offset, base + along.gaze)

    def _begin_near(self, base: Array) -> None:
        if float(np.abs(base - self._begun).max()) < _BEGIN_STEP:
            return
        self._begun = base.copy()
        begin = shot("follow", base, base)
        self._begin.position, self._begin.look_at = begin.position, begin.look_at

    def forget(self, client_id: int) -> None:
        """A view has closed."""
        self._along.pop(client_id, None)


def _put(client: viser.ClientHandle, position: Array, look_at: Array) -> None:
    with client.atomic():
        client.camera.position = position
        client.camera.look_at = look_at
