"""Where a view's camera stands: presets, each for the views of the one who asked, and one that goes along."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import viser

from rolling_panda.messages.page import CameraPreset
from rolling_panda.model.differential_drive import Array

#: A camera that goes along is moved when the base has gone so far (m).
_STEP = 0.004
#: Where a new view begins is told anew when the base has gone so far (m) or turned so far (rad).
_BEGIN_STEP = 0.3
#: A camera is so long on its way to a point (s). Who has moved a camera is not taken along for so long (s).
_FLIGHT_S, HOLD_OFF_S = 0.5, 8.0
#: It comes to rest so far from the point (m): no nearer than the first, no farther than the second.
_NEAREST, _FARTHEST = 0.5, 1.0
#: Where it comes from if not from where it is: behind the robot's shoulder, in the base's axes.
_USUAL = np.array([-0.55, -0.75, 0.4])
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


def near_shot(place: Array, position: Array, heading: float) -> Shot:
    """Where a camera looks at a place from: from where it is, but near, on the robot's side of the row and from above.

    Args:
        place: To be looked at (3, m, odom).
        position: Of the camera (3, m, odom).
        heading: Of the base (rad).
    """
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    away = position - place
    far = max(float(np.linalg.norm(away)), 1e-6)
    across, up = float(away @ turn[:, 1]) / far, float(away[2]) / far
    if across > -0.3 or not -0.1 < up < 0.8:
        away = turn @ _USUAL
        far = max(min(far, _FARTHEST), _NEAREST)
        return Shot(place + away * (far / float(np.linalg.norm(away))), place)
    return Shot(place + away * (max(min(far, _FARTHEST), _NEAREST) / far), place)


@dataclass(frozen=True)
class _Flight:
    begins: Shot
    ends: Shot
    since: float

    def at(self, now: float) -> Shot:
        share = min(max((now - self.since) / _FLIGHT_S, 0.0), 1.0)
        eased = share * share * (3.0 - 2.0 * share)
        return Shot(
            self.begins.position + eased * (self.ends.position - self.begins.position),
            self.begins.look_at + eased * (self.ends.look_at - self.begins.look_at),
        )


@dataclass
class _View:
    """Of one view: where its camera was put, where it was seen last, and when a hand has moved it.

    `flight` is under way, `place` is what it waits to be taken to.
    """

    put: deque[Array] = field(default_factory=lambda: deque(maxlen=60))
    seen: Array | None = None
    by_hand_at: float = -math.inf
    flight: _Flight | None = None
    place: Array | None = None


@dataclass
class _Along:
    client: viser.ClientHandle
    base: Array
    offset: Array
    gaze: Array


class SceneCameras:
    """Moves the cameras of views, and says where new ones begin: near the robot. Called from the server's loop."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Every camera stands where its owner leaves it."""
        self._along: dict[int, _Along] = {}
        self._views: dict[int, _View] = {}
        self._heading = 0.0
        self._now = -math.inf
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
            self._put(client, wanted)
            # Who says where a camera shall be wants it there for a while.
            view = self._view(client)
            view.by_hand_at, view.flight, view.place = self._now, None, None
            if preset == "follow":
                base = np.array([q[0], q[1], 0.0])
                self._along[client.client_id] = _Along(client, base, wanted.position - base, wanted.look_at - base)

    def fly(self, clients: list[viser.ClientHandle], place: Array, gently: bool = False) -> None:
        """Bring the cameras of these views to a place (3, m, odom), in a short flight.

        Args:
            clients: Their views.
            place: To be looked at.
            gently: Not before `HOLD_OFF_S` have passed since somebody moved the camera; then it is brought there.
        """
        for client in clients:
            view = self._view(client)
            if view.place is not None and bool((view.place == place).all()) and view.flight is not None:
                continue
            view.place, view.flight = place, None
            if not gently:
                view.by_hand_at = -math.inf

    def step(self, clients: list[viser.ClientHandle], now: float) -> None:
        """Take cameras on, and notice which ones somebody moves.

        Args:
            clients: All views.
            now: Monotonic time (s).
        """
        self._now = now
        for client in clients:
            view, position = self._view(client), np.array(client.camera.position)
            moved = view.seen is not None and float(np.abs(position - view.seen).max()) > _STEP
            view.seen = position
            if moved and not any(float(np.abs(position - put).max()) <= _ECHO for put in view.put):
                view.by_hand_at = now
                if view.flight is not None:
                    view.flight = view.place = None
            if view.place is None or now - view.by_hand_at < HOLD_OFF_S:
                continue
            if view.flight is None:
                self._along.pop(client.client_id, None)
                begins = Shot(position, np.array(client.camera.look_at))
                view.flight = _Flight(begins, near_shot(view.place, position, self._heading), now)
            here = view.flight.at(now)
            self._put(client, here)
            if now - view.flight.since >= _FLIGHT_S:
                view.flight = view.place = None

    def _view(self, client: viser.ClientHandle) -> _View:
        return self._views.setdefault(client.client_id, _View())

    def _put(self, client: viser.ClientHandle, wanted: Shot) -> None:
        self._view(client).put.append(wanted.position)
        with client.atomic():
            client.camera.position = wanted.position
            client.camera.look_at = wanted.look_at

    def follow(self, q: Array) -> None:
        """Take along the cameras that follow the base; whoever turns or moves theirs keeps it so, going along."""
        self._begin_near(q[:3])
        self._heading = float(q[2])
        base = np.array([q[0], q[1], 0.0])
        for along in list(self._along.values()):
            camera = along.client.camera
            position = np.array(camera.position)
            put = self._view(along.client).put
            if min(float(np.abs(position - each).max()) for each in put) > _ECHO:
                along.offset, along.gaze = position - along.base, np.array(camera.look_at) - along.base
                put.append(position)
            if float(np.abs(base - along.base).max()) < _STEP:
                continue
            along.base = base
            self._put(along.client, Shot(base + along.offset, base + along.gaze))

    def _begin_near(self, base: Array) -> None:
        if float(np.abs(base - self._begun).max()) < _BEGIN_STEP:
            return
        self._begun = base.copy()
        begin = shot("follow", base, base)
        self._begin.position, self._begin.look_at = begin.position, begin.look_at

    def forget(self, client_id: int) -> None:
        """A view has closed."""
        self._along.pop(client_id, None)
        self._views.pop(client_id, None)
