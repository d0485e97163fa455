"""How each session looks at the robot: its camera, its layers, and what it measures in the 3-D view."""

import asyncio
import time

import numpy as np

from rolling_panda import messages as m
from rolling_panda.messages.page import CameraPreset, Layer, Measured
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import configuration
from server.auth.sessions import Session
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.scene.camera_view import sight_of
from server.scene.markers import quat_wxyz
from server.scene.scene import Scene


class Looking:
    """What pages ask of the 3-D view. It moves nothing but cameras, and everybody who is signed in may."""

    def __init__(self, link: RobotLink, view: PageView, scene: Scene) -> None:
        """What the robot says over `link`, put together by `view`, is drawn into `scene`."""
        self._link, self._view, self._scene = link, view, scene
        self._drawn = 0
        self._plant: object = None

    def place_camera(self, session: Session, preset: CameraPreset) -> None:
        """Put the cameras of this session's views where `preset` has them, once the robot has said where it is."""
        now = time.monotonic()
        q, tool = self._configuration(now), self._view.tool(now)
        if q is not None and tool is not None:
            self._scene.place_camera(session.session_id, preset, q, np.array(tool.position))

    def show_layers(self, session: Session, layers: tuple[Layer, ...]) -> None:
        """Show these layers on this session's views and no others."""
        self._scene.show_layers(session.session_id, layers)

    def measured(self, owner: str, origin: m.Vector3, direction: m.Vector3) -> Measured | None:
        """`owner` measures, and has clicked along a line; the distance after every second click."""
        ends = self._scene.measure(owner, np.array(origin), np.array(direction))
        if ends is None:
            return None
        x, y, z = (ends[1].place - ends[0].place).tolist()
        return Measured(offset=(x, y, z), between=(ends[0].what, ends[1].what))

    async def draw(self, now: float) -> None:
        """Draw the newest picture of the camera for those who want it, and the tool's trail."""
        tool = self._view.tool(now)
        if tool is not None:
            self._scene.trail.take(tool.position)
        obstacles = self._link.obstacles.peek()
        if obstacles is not None and obstacles is not self._plant:
            self._plant = obstacles
            self._scene.show_plant(obstacles.message)
        camera = self._link.camera.peek()
        if camera is None or camera.message.sequence == self._drawn or not self._scene.sight_wanted:
            return
        frame = camera.message
        self._drawn = frame.sequence
        # Decoding takes some milliseconds, which the loop that sends the heartbeat has other use for.
        sight = await asyncio.to_thread(sight_of, frame)
        if sight is None:
            return
        pose = self._view.camera(frame)
        self._scene.show_sight(sight, np.array(quat_wxyz(pose.quat_xyzw)), np.array(pose.position))

    def _configuration(self, now: float) -> Array | None:
        posture = self._link.posture(now)
        return None if posture is None else configuration(posture.base, posture.position)
