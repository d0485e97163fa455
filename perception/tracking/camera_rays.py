"""Camera poses of recent frames, so that a click into any of them gives a ray."""

import threading
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from perception.arrays import Array
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.base_attitude import camera_in_odom
from rolling_panda.model.robot import RobotModel

#: Frames that can be clicked: ten minutes at two a second.
_MAX_FRAMES = 1200


@dataclass(frozen=True)
class Ray:
    """A ray in odom: origin (3, m) and unit direction (3)."""

    origin: Array
    direction: Array


class CameraRays:
    """Stores how the robot stood in frames. Thread-safe: the loop adds frames, the worker asks for rays."""

    def __init__(self) -> None:
        """Start without frames."""
        self._frames: dict[int, CameraFrame] = {}
        self._lock = threading.Lock()

    def add(self, frame: CameraFrame) -> None:
        """Store the camera pose of a frame; the oldest is dropped."""
        with self._lock:
            # Without the pictures, which are most of it.
            self._frames[frame.sequence] = replace(frame, color_jpeg=b"", depth_zlib=b"", labels_zlib=b"")
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
        k, camera = model.lens(stored.intrinsics), camera_in_odom(stored, model)
        col, row = u * k.width - 0.5, v * k.height - 0.5
        along = np.array([(col - k.cx) / k.fx, (row - k.cy) / k.fy, 1.0])
        direction = np.array(camera.rotation) @ (along / np.linalg.norm(along))
        return Ray(np.array(camera.translation), direction)
