"""The page's messages, built from the newest messages of the robot."""

import math
from typing import Any

import msgspec
import numpy as np

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.page import PagePlan, PagePoint, PagePoints, PageState
from rolling_panda.messages.perception import CameraMount
from rolling_panda.messages.robot import CameraFrame, JointState
from rolling_panda.messages.supervision import SessionPlan
from rolling_panda.messages.types import Role
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import ARM_Q, Limits, RobotModel, placement, pose_message
from rolling_panda.model.wire_values import vector3
from server.auth.sessions import Session
from server.robots.link import RobotLink

#: Where the count of frames alone has changed, all points are sent again after this time (s).
_FRAME_COUNT_PERIOD_S = 5.0
#: The cane's direction in an image is computed from a point so far along its tangent (m).
_TANGENT_STEP = 0.05


class PageView:
    """Builds `PageState` and `PagePoints`. The last known state stays, with its age.

    Attributes:
        model: Of the robot.
    """

    def __init__(
        self, link: RobotLink, model: RobotModel, relaxed_limits: tuple[m.Reason, ...] = (), plain_wire: bool = False
    ) -> None:
        """Build messages from what comes over `link`.

        Args:
            link: To read from.
            model: Projects points into the image, by the camera's calibration; it is changed.
            relaxed_limits: Limits of the server that are set wider than usual.
            plain_wire: Whether the robot's wire is unencrypted.
        """
        self._relaxed_limits, self._plain_wire = relaxed_limits, plain_wire
        self._link = link
        self.model = model
        self._mount: CameraMount | None = None
        self._seen: dict[str, m.PruningPoint] = {}
        self._built_from: tuple[object, ...] = ()
        self._built: PagePoints | None = None
        self._built_at = 0.0

    @property
    def arm_limits(self) -> tuple[tuple[float, float], ...]:
        """Lower and upper limit of each joint of the arm (rad)."""
        limits = self.model.limits
        return tuple(zip(limits.lower[ARM_Q].tolist(), limits.upper[ARM_Q].tolist(), strict=True))

    def state(self, number: int, viewers: int, now: float) -> PageState:
        """The current state, without a recipient; see `addressed`."""
        controller, bridge = self._link.controller.peek(), self._link.bridge.peek()
        replay = self._link.replay.peek()
        joints, odometry = self._link.joints.peek(), self._link.odometry.peek()
        seeing = self._link.camera_state.peek()
        if seeing is not None and seeing.message.mount != self._mount:
            self._mount = seeing.message.mount
            self.model.mount_camera(self._mount)
        camera, control = self._link.camera.peek(), self._link.control.peek()
        return PageState(
            number=number,
            user="",
            role="viewer",
            viewers=viewers,
            processes=self._link.presence(now),
            controller=msgspec.structs.replace(controller.message, queue=()) if controller else None,
            controller_age_s=max(now - controller.at, 0.0) if controller else None,
            bridge=bridge.message if bridge else None,
            bridge_age_s=max(now - bridge.at, 0.0) if bridge else None,
            joints=joints.message if joints else None,
            base=odometry.message.pose if odometry else None,
            camera_frame=camera.message.sequence if camera else 0,
            control=control.message if control else None,
            replay=replay.message if replay else None,
            stops=tuple(self._link.stops[process].message for process in sorted(self._link.stops)),
            # Several processes may read the same section of one file.
            relaxed_limits=tuple(
                dict.fromkeys(
                    (
                        *(bridge.message.relaxed_limits if bridge else ()),
                        *(controller.message.relaxed_limits if controller else ()),
                        *self._relaxed_limits,
                    )
                )
            ),
            plain_wire=self._plain_wire,
            camera_warning=seeing.message.warning if seeing else None,
            speed_ratios=() if joints is None else speed_ratios(joints.message, self.model.limits),
        )

    def tool(self, now: float) -> m.Pose | None:
        """Measured T_map_tool; None before the first posture."""
        posture = self._link.posture(now)
        if posture is None:
            return None
        return pose_message(posture.where.pose_in_map(self.model.pose(posture.q, self.model.tool_id)))

    def in_odom(self, T_map_tool: m.Pose) -> m.Pose:
        """T_odom_tool of a pose of the tool in map."""
        where = self._link.map_frame
        return T_map_tool if where.T_map_level is None else pose_message(where.pose_in_odom(placement(T_map_tool)))

    def camera(self, frame: CameraFrame) -> m.Pose:
        """T_map_camera when a frame was taken."""
        return pose_message(camera_pose(frame, self.model, self._link.map_frame))

    def points(self, now: float) -> PagePoints:
        """All points in the order of work; points that perception no longer reports stay while they are queued.

        Returns the same object while nothing has changed; a change of the frame count alone is delayed.
        """
        received, controller = self._link.points.peek(), self._link.controller.peek()
        camera = self._link.camera.peek()
        queue = controller.message.queue if controller else ()
        plan = self._link.plan.peek()
        built_from = (received, camera, queue, plan)
        before = self._built
        if before is not None and built_from == self._built_from:
            return before
        built = self._build_points(
            received.message if received else None,
            queue,
            camera.message if camera else None,
            plan.message if plan else None,
        )
        self._built_from = built_from
        if before is not None:
            recounted = msgspec.structs.replace(before, frames=built.frames)
            if built == before or (built == recounted and now - self._built_at <= _FRAME_COUNT_PERIOD_S):
                return before
        self._built, self._built_at = built, now
        return built

    def _build_points(
        self,
        perceived: m.PruningPoints | None,
        queue: tuple[m.QueueEntry, ...],
        camera: CameraFrame | None,
        plan: SessionPlan | None,
    ) -> PagePoints:
        points = perceived.points if perceived else ()
        queued = {entry.point_id for entry in queue}
        current = {point.point_id: point for point in points}
        recorded = {entry.point_id: entry.recorded for entry in queue if entry.recorded is not None}
        self._seen = recorded | {key: point for key, point in self._seen.items() if key in queued} | current
        rows = [(self._seen[entry.point_id], entry) for entry in queue if entry.point_id in self._seen]
        rows += [
            (point, m.QueueEntry(point.point_id, "PROPOSED", reasons.not_queued_yet()))
            for point in points
            if point.point_id not in queued
        ]
        where = self._link.map_frame
        pixels = project([point.position for point, _ in rows], camera, self.model, where)
        ahead = project([_ahead(point) for point, _ in rows], camera, self.model, where)
        planned = {} if plan is None or plan.state != "valid" else {each.point_id: each for each in plan.points}
        return PagePoints(
            points=tuple(
                PagePoint(
                    point,
                    entry,
                    pixel,
                    _angle(pixel, next_pixel),
                    planned.get(point.point_id) if entry.state in ("ACCEPTED", "UNREACHABLE") else None,
                )
                for (point, entry), pixel, next_pixel in zip(rows, pixels, ahead, strict=True)
            ),
            undecided_sites=perceived.undecided_sites if perceived else (),
            segmenter=perceived.segmenter if perceived else "",
            frames=perceived.frames if perceived else 0,
            image_size=(camera.intrinsics.width, camera.intrinsics.height) if camera else (0, 0),
            plan=PagePlan(plan.state, plan.reason, plan.plan_hash, plan.duration_s) if plan else None,
            rule=perceived.rule if perceived else None,
        )


def _ahead(point: m.PruningPoint) -> m.Vector3:
    """A point on the cane's tangent, past the cut."""
    return vector3(np.array(point.position) + _TANGENT_STEP * np.array(point.tangent))


def _angle(here: tuple[float, float] | None, there: tuple[float, float] | None) -> float | None:
    """Direction from one pixel to another (rad); None where the cane points at the camera or leaves the image."""
    if here is None or there is None or here == there:
        return None
    return round(math.atan2(there[1] - here[1], there[0] - here[0]), 2)


def addressed(state: PageState, session: Session) -> PageState:
    """The same state for one recipient."""
    role: Role = session.role
    return msgspec.structs.replace(state, user=session.user, role=role, client=session.client)


def camera_pose(frame: CameraFrame, model: RobotModel, where: MapFrame) -> Any:
    """T_map_camera (pin.SE3) when a frame was taken."""
    return where.camera(frame, model)


def project(
    positions: list[m.Vector3], frame: CameraFrame | None, model: RobotModel, where: MapFrame
) -> list[tuple[float, float] | None]:
    """Pixels of points in map (m) in a camera frame, whole numbers; None where outside the image or behind."""
    if frame is None or not positions:
        return [None] * len(positions)
    camera = camera_pose(frame, model, where)
    points = (np.array(positions) - camera.translation) @ camera.rotation
    lens = model.lens(frame.intrinsics)
    pixels: list[tuple[float, float] | None] = []
    for x, y, z in points:
        if z < 0.05:
            pixels.append(None)
            continue
        u, v = float(round(lens.fx * x / z + lens.cx)), float(round(lens.fy * y / z + lens.cy))
        pixels.append((u, v) if 0 <= u < lens.width and 0 <= v < lens.height else None)
    return pixels


def speed_ratios(joints: JointState, limits: Limits) -> tuple[float, ...]:
    """Speed of each actuator as a fraction of its limit, wheels first (9)."""
    return tuple(np.round(np.abs(joints.velocity) / limits.velocity, 3).tolist())
