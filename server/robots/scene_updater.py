"""Draws the robot's newest messages into the 3-D view, and applies what a session asks of its own views."""

import asyncio
import math
import time

import numpy as np

from rolling_panda import messages as m
from rolling_panda.messages.page import CameraPreset, Layer, Measured, PagePoints
from rolling_panda.messages.perception import Scenery
from rolling_panda.messages.supervision import ArmAngles
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q
from rolling_panda.model.wire_values import vector3
from rolling_panda.transport.inbox import Received
from server.auth.sessions import Session
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.scene.camera_view import decode_frame
from server.scene.meshes import quat_wxyz
from server.scene.scene import Scene

#: A posture older than this (s) is drawn grey.
_STALE_S = 1.0


class SceneUpdater:
    """Updates the scene of one robot. Every role may change its own views, which moves nothing but cameras."""

    def __init__(self, link: RobotLink, view: PageView, scene: Scene) -> None:
        """Draw into `scene` what comes over `link`, with the poses that `view` computes."""
        self._link, self._view, self._scene = link, view, scene
        self._points: object = None
        self._camera_sequence = 0
        self._obstacles: object = None
        self._scenery: Received[Scenery] | None = None
        #: When the present row was first heard of (s): what moved before moved in another one.
        self._row_since = -math.inf

    def place_camera(self, session: Session, preset: CameraPreset) -> None:
        """Move the cameras of this session's views to a preset, once the robot's posture is known."""
        posture = self._link.posture(time.monotonic())
        if posture is not None:
            self._scene.place_camera(session.session_id, preset, posture.q, posture.where)

    def show_posture(self, session: Session, angles: ArmAngles | None) -> None:
        """Show the arm in a posture (7, rad) on this session's views, where the base stands; None hides it."""
        posture = self._link.posture(time.monotonic())
        q: Array | None = None
        if angles is not None and posture is not None:
            q = posture.q_in_map.copy()
            q[ARM_Q] = angles
        self._scene.show_posture(session.session_id, q)

    def show_layers(self, session: Session, layers: tuple[Layer, ...]) -> None:
        """Show these layers on this session's views and no others."""
        self._scene.show_layers(session.session_id, layers)

    def measure(self, owner: str, origin: m.Vector3, direction: m.Vector3) -> Measured | None:
        """`owner`, who measures, has clicked along a ray; returns the distance after every second click."""
        points = self._scene.measure(owner, np.array(origin), np.array(direction))
        if points is None:
            return None
        offset = vector3(points[1].position - points[0].position)
        return Measured(offset=offset, between=(points[0].surface, points[1].surface))

    async def step(self, now: float) -> None:
        """Draw the robot as measured, and continue the animations."""
        self._scene.step_cameras(now)
        posture = self._link.posture(now)
        if posture is not None:
            self._scene.move(posture.q, posture.where)
            self._scene.robot.set_grey(posture.age_s > _STALE_S)
        self._scene.falling.step(now)

    async def update(self, points: PagePoints, now: float) -> None:
        """Draw the points and whatever else has changed: cuts, canes, preview, row, obstacles, trail, camera frame."""
        link, scene = self._link, self._scene
        if points is not self._points:
            self._points = points
            scene.show_points(points.points, points.undecided_sites)
        bridge = link.bridge.peek()
        scene.show_cuts(points.points, None if bridge is None else bridge.message, now)
        if (received := link.points.peek()) is not None:
            scene.show_canes(received.message.canes)
        if (preview := link.preview_motion.peek()) is not None:
            scene.ghost.set_motion(preview.message)
        if (scenery := link.scenery.peek()) is not None and scenery is not self._scenery:
            if self._scenery is not None and _another_row(self._scenery.message, scenery.message):
                self._row_since = scenery.at
            self._scenery = scenery
            scene.show_row(scenery.message, now)
        motion = link.scenery_motion.peek()
        if motion is not None and motion.at >= self._row_since and scene.shows_row:
            scene.show_row_motion(motion.message)
        if (obstacles := link.obstacles.peek()) is not None and obstacles is not self._obstacles:
            self._obstacles = obstacles
            scene.show_plant(obstacles.message)
        if (tool := self._view.tool(now)) is not None:
            scene.trail.extend(tool.position)
        await self._draw_camera_frame()

    async def _draw_camera_frame(self) -> None:
        camera = self._link.camera.peek()
        if camera is None or camera.message.sequence == self._camera_sequence or not self._scene.shows_camera_frames:
            return
        frame = camera.message
        self._camera_sequence = frame.sequence
        # Decoding takes some milliseconds, which would delay the heartbeat on the loop.
        decoded = await asyncio.to_thread(decode_frame, frame)
        if decoded is not None:
            pose = self._view.camera(frame)
            self._scene.show_camera_frame(decoded, np.array(quat_wxyz(pose.quat_xyzw)), np.array(pose.position))


def _another_row(before: Scenery, now: Scenery) -> bool:
    """Whether the row is not the one before with more of it cut: a bridge that starts again counts anew."""
    return now.revision <= before.revision and now.capsules != before.capsules
