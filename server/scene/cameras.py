"""Cameras of the views: presets, following base or tool, and flights to a point; each for one session's views."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import viser

from rolling_panda.messages.page import CameraPreset
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array
from server.scene.sight import clear_direction, directions

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
#: Vertical field of view of the first camera of a view (rad).
FOV = 0.82
#: Distance of the preset `tool` from the blades (m).
_TOOL_DISTANCE = 0.5
#: The preset `tool` looks at a place so far ahead of the blades (m): there is what they will cut.
_AHEAD = 0.12
#: A view reports its camera with a delay. Farther than this (m) from each commanded position, the user has moved it.
_ECHO = 0.03


@dataclass(frozen=True)
class CameraPose:
    """Position of a camera and the point that it looks at (3 each, m, map)."""

    position: Array
    look_at: Array


def preset_pose(
    preset: CameraPreset, q: Array, tool: Array, ahead: Array | None = None, rods: Sequence[Capsule] = ()
) -> CameraPose:
    """The camera pose of a preset.

    Args:
        preset: `follow` looks over the robot along the row and follows the base; `row` shows several vines from a
            distance; `tool` shows the blades and what lies before them, and follows the tool; `top` looks down on robot
            and row.
        q: Configuration of the robot (12).
        tool: Position of the tool (3, m, map).
        ahead: Direction in which the blades point (3, unit, map); to the base's left by default.
        rods: The robot, as far as it can hide the blades.
    """
    base = np.array([q[0], q[1], 0.0])
    turn = _turned(q[2])
    if preset == "tool":
        ahead = turn[:, 1] if ahead is None else ahead
        wanted = -0.5 * ahead + 0.45 * turn[:, 0] + np.array([0.0, 0.0, 0.6])
        wanted /= float(np.linalg.norm(wanted))
        # Not from below, nor so far ahead that the blades point at the camera.
        others = [each for each in _around(turn) if each[2] > 0.1 and float(each @ ahead) < 0.5]
        direction = clear_direction(tool, _TOOL_DISTANCE, wanted, others, rods)
        return CameraPose(tool + _TOOL_DISTANCE * direction, tool + _AHEAD * ahead)
    position, look_at = {
        "follow": ([-1.45, -1.95, 1.85], [0.45, 0.75, 0.95]),
        "row": ([0.6, -3.3, 1.7], [0.6, 0.75, 0.9]),
        "top": ([0.3, 0.0, 4.6], [0.3, 0.35, 0.6]),
    }[preset]
    return CameraPose(base + turn @ position, base + turn @ look_at)


def close_up(point: Array, position: Array, heading: float, rods: Sequence[Capsule] = ()) -> CameraPose:
    """A close-up of a point, with the point in the middle and the robot not in front of it.

    From the camera's direction where that is on the robot's side of the row and above it.

    Args:
        point: To look at (3, m, map).
        position: Of the camera (3, m, map).
        heading: Of the base (rad).
        rods: The robot, as far as it can hide the point.
    """
    turn = _turned(heading)
    away = position - point
    far = max(float(np.linalg.norm(away)), 1e-6)
    across, up = float(away @ turn[:, 1]) / far, float(away[2]) / far
    if across > -0.3 or not -0.1 < up < 0.8:
        away = turn @ _DEFAULT_OFFSET
    distance = max(min(far, _FARTHEST), _NEAREST)
    others = [each for each in _around(turn) if float(each @ turn[:, 1]) < -0.25]
    wanted = away / float(np.linalg.norm(away))
    return CameraPose(point + distance * clear_direction(point, distance, wanted, others, rods), point)


def _turned(heading: float) -> Array:
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _around(turn: Array) -> list[Array]:
    return directions(np.radians(np.arange(0, 360, 20)).tolist(), np.radians([8.0, 25.0, 45.0]).tolist(), turn)


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
    """A camera that goes with the base, or with the tool: `at` is where that was."""

    client: viser.ClientHandle
    tool: bool
    at: Array
    offset: Array
    look_at_offset: Array


class SceneCameras:
    """Moves the cameras of views, and the initial camera of new ones. Called from the server's loop."""

    def __init__(self, server: viser.ViserServer) -> None:
        """No camera is moved yet."""
        self._followers: dict[int, _Follower] = {}
        self._views: dict[int, _View] = {}
        self._heading = 0.0
        self._rods: Callable[[], Sequence[Capsule]] = tuple
        self._now = -math.inf
        self._initial_camera = server.initial_camera
        self._initial_camera.fov = FOV
        self._initial_base = np.full(3, np.inf)
        self._update_initial_camera(np.zeros(3))

    def hides(self, rods: Callable[[], Sequence[Capsule]]) -> None:
        """Look past these rods from now on: the robot as it stands when a camera is moved."""
        self._rods = rods

    def apply_preset(
        self,
        preset: CameraPreset,
        clients: list[viser.ClientHandle],
        q: Array,
        tool: Array,
        ahead: Array | None = None,
    ) -> None:
        """Move the cameras of these views to a preset; arguments as of `preset_pose`."""
        pose = preset_pose(preset, q, tool, ahead, self._rods())
        for client in clients:
            self._followers.pop(client.client_id, None)
            client.camera.up_direction = (0.0, 0.0, 1.0)
            self._command(client, pose)
            # A preset counts as a motion by the user, who wants it to stay for a while.
            view = self._view(client)
            view.user_moved_at, view.flight, view.target = self._now, None, None
            if preset in ("follow", "tool"):
                at = tool.copy() if preset == "tool" else np.array([q[0], q[1], 0.0])
                self._followers[client.client_id] = _Follower(
                    client, preset == "tool", at, pose.position - at, pose.look_at - at
                )

    def fly(self, clients: list[viser.ClientHandle], point: Array, wait_for_user: bool = False) -> None:
        """Fly the cameras of these views to a point (3, m, map).

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
                view.flight = _Flight(start, close_up(view.target, position, self._heading, self._rods()), now)
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

    def follow(self, q: Array, tool: Array | None = None) -> None:
        """Move the cameras that follow base or tool (3, m, map); an offset that the user has changed is kept."""
        self._update_initial_camera(q[:3])
        self._heading = float(q[2])
        base = np.array([q[0], q[1], 0.0])
        for follower in list(self._followers.values()):
            at = tool if follower.tool else base
            if at is None:
                continue
            camera = follower.client.camera
            position = np.array(camera.position)
            commanded = self._view(follower.client).commanded
            if min(float(np.abs(position - each).max()) for each in commanded) > _ECHO:
                follower.offset = position - follower.at
                follower.look_at_offset = np.array(camera.look_at) - follower.at
                commanded.append(position)
            if float(np.abs(at - follower.at).max()) < _STEP:
                continue
            follower.at = at.copy()
            self._command(follower.client, CameraPose(at + follower.offset, at + follower.look_at_offset))

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
