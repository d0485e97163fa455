"""Cameras of the views: presets, following the base, and flights to a point; each applies to one session's views."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import viser

from rolling_panda.messages.page import CameraPreset
from rolling_panda.model.differential_drive import Array

#: A following camera is moved when the base has moved so far (m).
_STEP = 0.004
#: The initial camera of new views is updated when the base has moved so far (m) or turned so far (rad).
_INITIAL_CAMERA_STEP = 0.3
#: Duration of a flight (s), and time for which a camera moved by the user is not flown automatically (s).
_FLIGHT_S, USER_PRIORITY_S = 0.5, 8.0
#: Smallest and largest distance from the point at the end of a flight (m).
_NEAREST, _FARTHEST = 0.5, 1.0
#: Default direction of a close-up: from behind the robot's shoulder, in the base's axes.
_DEFAULT_OFFSET = np.array([-0.55, -0.75, 0.4])
#: A view reports its camera with a delay. Farther than this (m) from each commanded position, the user has moved it.
_ECHO = 0.03


@dataclass(frozen=True)
class CameraPose:
    """Position of a camera and the point that it looks at (3 each, m, odom)."""

    position: Array
    look_at: Array


def preset_pose(preset: CameraPreset, q: Array, tool: Array) -> CameraPose:
    """The camera pose of a preset.

    Args:
        preset: `follow` looks over the robot along the row and follows the base; `row` shows several vines from a
            distance; `tool` is near the tool; `top` looks down on robot and row.
        q: Configuration of the robot (12).
        tool: Position of the tool (3, m, odom).
    """
    base = np.array([q[0], q[1], 0.0])
    c, s = math.cos(q[2]), math.sin(q[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    if preset == "tool":
        return CameraPose(tool + turn @ [-0.45, -0.6, 0.35], tool)
    position, look_at = {
        "follow": ([-1.45, -1.95, 1.85], [0.3, 0.45, 0.8]),
        "row": ([0.6, -3.6, 1.9], [0.6, 0.7, 0.9]),
        "top": ([0.3, 0.0, 4.6], [0.3, 0.35, 0.6]),
    }[preset]
    return CameraPose(base + turn @ position, base + turn @ look_at)


def close_up(point: Array, position: Array, heading: float) -> CameraPose:
    """A close-up of a point: from the camera's direction where that is on the robot's side of the row and above it.

    Args:
        point: To look at (3, m, odom).
        position: Of the camera (3, m, odom).
        heading: Of the base (rad).
    """
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    away = position - point
    far = max(float(np.linalg.norm(away)), 1e-6)
    across, up = float(away @ turn[:, 1]) / far, float(away[2]) / far
    if across > -0.3 or not -0.1 < up < 0.8:
        away = turn @ _DEFAULT_OFFSET
        far = max(min(far, _FARTHEST), _NEAREST)
        return CameraPose(point + away * (far / float(np.linalg.norm(away))), point)
    return CameraPose(point + away * (max(min(far, _FARTHEST), _NEAREST) / far), point)


@dataclass(frozen=True)
class _Flight:
    start: CameraPose
    end: CameraPose
    started_at: float

    def at(self, now: float) -> CameraPose:
        fraction = min(max((now - self.started_at) / _FLIGHT_S, 0.0), 1.0)
        eased = fraction * fraction * (3.0 - 2.0 * fraction)
        return CameraPose(
            self.start.position + eased * (self.end.position - self.start.position),
            self.start.look_at + eased * (self.end.look_at - self.start.look_at),
        )


@dataclass
class _View:
    """The camera of one view.

    Attributes:
        commanded: Its last commanded positions.
        reported: Its last reported position.
        user_moved_at: When the user has moved it (s).
        flight: Under way.
        target: The point that it flies to, or will.
    """

    commanded: deque[Array] = field(default_factory=lambda: deque(maxlen=60))
    reported: Array | None = None
    user_moved_at: float = -math.inf
    flight: _Flight | None = None
    target: Array | None = None


@dataclass
class _Follower:
    client: viser.ClientHandle
    base: Array
    offset: Array
    look_at_offset: Array


class SceneCameras:
    """Moves the cameras of views, and the initial camera of new ones. Called from the server's loop."""

    def __init__(self, server: viser.ViserServer) -> None:
        """No camera is moved yet."""
        self._followers: dict[int, _Follower] = {}
        self._views: dict[int, _View] = {}
        self._heading = 0.0
        self._now = -math.inf
        self._initial_camera = server.initial_camera
        self._initial_camera.fov = 0.82
        self._initial_base = np.full(3, np.inf)
        self._update_initial_camera(np.zeros(3))

    def apply_preset(self, preset: CameraPreset, clients: list[viser.ClientHandle], q: Array, tool: Array) -> None:
        """Move the cameras of these views to a preset."""
        pose = preset_pose(preset, q, tool)
        for client in clients:
            self._followers.pop(client.client_id, None)
            client.camera.up_direction = (0.0, 0.0, 1.0)
            self._command(client, pose)
            # A preset counts as a motion by the user, who wants it to stay for a while.
            view = self._view(client)
            view.user_moved_at, view.flight, view.target = self._now, None, None
            if preset == "follow":
                base = np.array([q[0], q[1], 0.0])
                self._followers[client.client_id] = _Follower(client, base, pose.position - base, pose.look_at - base)

    def fly(self, clients: list[viser.ClientHandle], point: Array, wait_for_user: bool = False) -> None:
        """Fly the cameras of these views to a point (3, m, odom).

        Args:
            clients: Their views.
            point: To look at.
            wait_for_user: Not before `USER_PRIORITY_S` have passed since the user moved the camera.
        """
        for client in clients:
            view = self._view(client)
            if view.target is not None and bool((view.target == point).all()) and view.flight is not None:
                continue
            view.target, view.flight = point, None
            if not wait_for_user:
                view.user_moved_at = -math.inf

    def step(self, clients: list[viser.ClientHandle], now: float) -> None:
        """Continue the flights, and detect cameras that the user has moved.

        Args:
            clients: All views.
            now: Monotonic time (s).
        """
        self._now = now
        for client in clients:
            view, position = self._view(client), np.array(client.camera.position)
            moved = view.reported is not None and float(np.abs(position - view.reported).max()) > _STEP
            view.reported = position
            if moved and not any(float(np.abs(position - each).max()) <= _ECHO for each in view.commanded):
                view.user_moved_at = now
                if view.flight is not None:
                    view.flight = view.target = None
            if view.target is None or now - view.user_moved_at < USER_PRIORITY_S:
                continue
            if view.flight is None:
                self._followers.pop(client.client_id, None)
                start = CameraPose(position, np.array(client.camera.look_at))
                view.flight = _Flight(start, close_up(view.target, position, self._heading), now)
            self._command(client, view.flight.at(now))
            if now - view.flight.started_at >= _FLIGHT_S:
                view.flight = view.target = None

    def _view(self, client: viser.ClientHandle) -> _View:
        return self._views.setdefault(client.client_id, _View())

    def _command(self, client: viser.ClientHandle, pose: CameraPose) -> None:
        self._view(client).commanded.append(pose.position)
        with client.atomic():
            client.camera.position = pose.position
            client.camera.look_at = pose.look_at

    def follow(self, q: Array) -> None:
        """Move the cameras that follow the base; an offset that the user has changed is kept."""
        self._update_initial_camera(q[:3])
        self._heading = float(q[2])
        base = np.array([q[0], q[1], 0.0])
        for follower in list(self._followers.values()):
            camera = follower.client.camera
            position = np.array(camera.position)
            commanded = self._view(follower.client).commanded
            if min(float(np.abs(position - each).max()) for each in commanded) > _ECHO:
                follower.offset, follower.look_at_offset = (
                    position - follower.base,
                    np.array(camera.look_at) - follower.base,
                )
                commanded.append(position)
            if float(np.abs(base - follower.base).max()) < _STEP:
                continue
            follower.base = base
            self._command(follower.client, CameraPose(base + follower.offset, base + follower.look_at_offset))

    def _update_initial_camera(self, base: Array) -> None:
        if float(np.abs(base - self._initial_base).max()) < _INITIAL_CAMERA_STEP:
            return
        self._initial_base = base.copy()
        pose = preset_pose("follow", base, base)
        self._initial_camera.position, self._initial_camera.look_at = pose.position, pose.look_at

    def forget(self, client_id: int) -> None:
        """A view has closed."""
        self._followers.pop(client_id, None)
        self._views.pop(client_id, None)
