"""Camera poses of recent frames, so that a click into any of them gives a ray."""

import threading
from dataclasses import dataclass

import numpy as np

from perception.arrays import Array
from rolling_panda import messages as m
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.robot import RobotModel, configuration

#: Frames that can be clicked: ten minutes at two a second.
_MAX_FRAMES = 1200


@dataclass(frozen=True)
class Ray:
    """A ray in odom: origin (3, m) and unit direction (3)."""

    origin: Array
    direction: Array


class CameraRays:
    """Stores the joint positions of frames. Thread-safe: the loop adds frames, the worker asks for rays."""

    def __init__(self) -> None:
        """Start without frames."""
        self._frames: dict[int, tuple[Intrinsics, m.PlanarPose, m.Actuated]] = {}
        self._lock = threading.Lock()

    def add(self, frame: CameraFrame) -> None:
        """Store the camera pose of a frame; the oldest is dropped."""
        with self._lock:
            self._frames[frame.sequence] = frame.intrinsics, frame.base, frame.position
            while len(self._frames) > _MAX_FRAMES:
                del self._frames[next(iter(self._frames))]

    def ray(self, sequence: int, u: float, v: float, model: RobotModel) -> Ray | None:
        """The ray through a place in a frame; None where the frame is not stored.

        Args:
            sequence: Of the frame.
            u: Column, as a fraction of the width.
            v: Row, as a fraction of the height.
            model: The robot; its `data` is overwritten.
        """
        with self._lock:
            stored = self._frames.get(sequence)
        if stored is None:
            return None
        reported, base, position = stored
        k = model.lens(reported)
        camera = model.pose(configuration(base, position), model.camera_id)
        col, row = u * k.width - 0.5, v * k.height - 0.5
        along = np.array([(col - k.cx) / k.fx, (row - k.cy) / k.fy, 1.0])
        direction = np.array(camera.rotation) @ (along / np.linalg.norm(along))
        return Ray(np.array(camera.translation), direction)
